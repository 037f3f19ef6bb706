#include "app/certificate/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "app/certificate/effect_words.h"
#include "app/figure/plot.h"

namespace plumbline::app {
namespace {

struct Rgb {
  double r, g, b;
};

std::string hex(Rgb c) {
  const auto byte = [](double v) {
    return static_cast<int>(std::lround(std::clamp(v, 0.0, 255.0)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(c.r), byte(c.g), byte(c.b));
}

// Blue below, white at zero, orange above: apart for every kind of colour vision. `share` −1 … 1.
std::string diverging(double share) {
  const Rgb low{33, 102, 172}, high{179, 88, 6}, white{250, 250, 250};
  const double s = std::clamp(share, -1.0, 1.0);
  const Rgb& end = s < 0 ? low : high;
  const double t = std::pow(std::abs(s), 0.8);
  return hex({white.r + t * (end.r - white.r), white.g + t * (end.g - white.g),
              white.b + t * (end.b - white.b)});
}

constexpr std::array<const char*, kAxisCount> kAxisColor = {palette::kBlue, palette::kOrange,
                                                            palette::kGreen};
/// Smallest of 1, 2, 5 × a power of ten that is not below `value`.
double nice_ceiling(double value) {
  if (!(value > 0)) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (double step : {1.0, 1.5, 2.0, 3.0, 5.0, 7.0}) {
    if (step * power >= value * (1 - 1e-9)) return step * power;
  }
  return 10 * power;
}

double largest_residual(const Calibration& calibration, bool before_too) {
  double largest = 0;
  for (const PoseResult& pose : calibration.pose_results) {
    for (double r : pose.residual_after_mps2) largest = std::max(largest, std::abs(r));
    if (!before_too) continue;
    for (double r : pose.residual_before_mps2) largest = std::max(largest, std::abs(r));
  }
  return largest;
}

/// What an axis has to show of these values, with a little room on both sides.
std::pair<double, double> range(const std::vector<double>& values) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  const double margin = high > low ? 0.03 * (high - low) : std::max(1e-3 * std::abs(high), 1e-9);
  return {low - margin, high + margin};
}

constexpr std::size_t kLongestTitle = 36;  ///< characters over a panel

double span_or(double step, double fallback) { return step > 0 ? step : fallback; }

// + or − in a cell whose residual exceeds twice what is expected: the sign survives without colour.
void draw_sign(Canvas& canvas, Point centre, double size, bool positive) {
  const Stroke mark{palette::kBlack, 0.9, {}};
  canvas.line({centre.x - size, centre.y}, {centre.x + size, centre.y}, mark);
  if (positive) canvas.line({centre.x, centre.y - size}, {centre.x, centre.y + size}, mark);
}

void draw_color_bar(Canvas& canvas, Point top_left, double width, double scale,
                    const Translator& tr) {
  constexpr int kSteps = 60;
  for (int i = 0; i < kSteps; ++i) {
    canvas.rectangle({top_left.x + width * i / kSteps, top_left.y}, width / kSteps + 0.5, 10,
                     diverging(2.0 * (i + 0.5) / kSteps - 1));
  }
  PlotAxis axis{tr("residual, m/s²"), -scale, scale};
  axis.ticks = 6;
  const auto ticks = tick_positions(axis);
  const auto texts = tick_texts(axis, ticks);
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double x = top_left.x + width * (ticks[i] + scale) / (2 * scale);
    canvas.line({x, top_left.y + 10}, {x, top_left.y + 13}, {palette::kBlack, 0.8, {}});
    canvas.text({x, top_left.y + 24}, texts[i], {10, Anchor::middle});
  }
  canvas.text({top_left.x + width + 12, top_left.y + 10}, axis.label, {11});
}

}  // namespace

Figure residual_map(const FigureContext& context, const Grid& grid) {
  const bool both = context.calibration->diagnosis.enlarges_model();
  Figure figure;
  figure.caption = context.tr(
      "Residual of every pose over δ and h, one colour scale for all maps. Cells beyond twice the "
      "expected residual carry their sign.");
  if (both) {
    figure.caption += " " + context.tr("Left before, right after the added effects.");
  }
  figure.description =
      context.tr("Maps of the residual over spindle angle and tilt for the axes x, y and z");
  figure.width = kFigureWidth;
  const double cell_delta = span_or(grid.delta.step_deg, 10), cell_h = span_or(grid.h.step_deg, 10);
  constexpr double kMapHeight = 100, kGap = 26, kTop = 22;
  figure.height = kTop + 3 * (kMapHeight + kGap) + 68;
  figure.draw = [context, cell_delta, cell_h, both](Canvas& canvas) {
    const Calibration& calibration = *context.calibration;
    double h_low = 1e9, h_high = -1e9, d_low = 1e9, d_high = -1e9;
    for (const PoseResult& p : calibration.pose_results) {
      h_low = std::min(h_low, p.pose.h_deg);
      h_high = std::max(h_high, p.pose.h_deg);
      d_low = std::min(d_low, p.pose.delta_deg);
      d_high = std::max(d_high, p.pose.delta_deg);
    }
    if (calibration.pose_results.empty()) return;
    const double scale = nice_ceiling(largest_residual(calibration, both));
    const int columns = both ? 2 : 1;
    const double width = (kFigureWidth - 58 - 12 - (columns - 1) * 26) / columns;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const double top = kTop + static_cast<double>(i) * (kMapHeight + kGap);
      for (int column = 0; column < columns; ++column) {
        const bool before = both && column == 0;
        PlotAxis x{i == 2 ? context.tr("δ, degrees") : "", d_low - cell_delta / 2,
                   d_high + cell_delta / 2};
        x.ticks = both ? 7 : 12;
        x.tick_labels = i == 2;
        PlotAxis y{column == 0 ? context.tr("h, degrees") : "", h_low - cell_h / 2,
                   h_high + cell_h / 2};
        y.tick_labels = column == 0;
        Plot plot(canvas, {58 + column * (width + 26), top}, width, kMapHeight, x, y);
        std::string title = context.tr("{} axis", kAxisName[i]);
        if (both) title += before ? context.tr(", before") : context.tr(", after");
        plot.draw_frame(title);
        for (const PoseResult& p : calibration.pose_results) {
          const double r = before ? p.residual_before_mps2[i] : p.residual_after_mps2[i];
          const Point a = plot.at(p.pose.delta_deg - cell_delta / 2, p.pose.h_deg + cell_h / 2);
          const Point b = plot.at(p.pose.delta_deg + cell_delta / 2, p.pose.h_deg - cell_h / 2);
          canvas.rectangle(a, b.x - a.x, b.y - a.y, diverging(r / scale));
          if (std::abs(r) > 2 * calibration.floor_pose_rms_mps2[i]) {
            draw_sign(canvas, {(a.x + b.x) / 2, (a.y + b.y) / 2}, both ? 1.8 : 2.5, r > 0);
          }
        }
      }
    }
    draw_color_bar(canvas, {180, kTop + 3 * (kMapHeight + kGap) + 24}, 320, scale, context.tr);
  };
  return figure;
}

Figure residual_histogram(const FigureContext& context) {
  Figure figure;
  figure.caption = context.tr(
      "Residuals of the poses in units of what the identified noise alone would leave (bars), and "
      "the normal distribution that they should follow (line).");
  figure.description = context.tr("Histograms of the normalised residuals for the axes x, y and z");
  figure.width = kFigureWidth;
  figure.height = 230;
  figure.draw = [context](Canvas& canvas) {
    const Calibration& calibration = *context.calibration;
    constexpr double kRange = 5, kBinWidth = 0.5;
    constexpr auto kBins = static_cast<std::size_t>(2 * kRange / kBinWidth);
    const auto count = static_cast<double>(calibration.pose_results.size());
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      std::vector<double> bins(kBins, 0);
      std::size_t outside = 0;
      for (const PoseResult& p : calibration.pose_results) {
        const double z = p.residual_after_mps2[i] / calibration.floor_pose_rms_mps2[i];
        if (!(std::abs(z) < kRange)) {
          ++outside;
          continue;
        }
        ++bins[static_cast<std::size_t>((z + kRange) / kBinWidth)];
      }
      const double expected_peak = count * kBinWidth / std::sqrt(2 * std::numbers::pi);
      const double top =
          1.1 * std::max({expected_peak, *std::max_element(bins.begin(), bins.end()), 1.0});
      PlotAxis x{context.tr("residual / expected"), -kRange, kRange};
      PlotAxis y{i == 0 ? context.tr("poses") : "", 0, top};
      Plot plot(canvas, {52 + static_cast<double>(i) * 222, 26}, 190, 150, x, y);
      plot.draw_frame(outside == 0 ? context.tr("{} axis", kAxisName[i])
                                   : context.tr("{} axis ({} beyond ±5)", kAxisName[i], outside));
      for (std::size_t b = 0; b < kBins; ++b) {
        const double from = -kRange + static_cast<double>(b) * kBinWidth;
        if (bins[b] > 0) plot.bar(from + 0.03, from + kBinWidth - 0.03, bins[b], palette::kSky);
      }
      std::vector<double> xs, ys;
      for (double z = -kRange; z <= kRange + 1e-9; z += 0.1) {
        xs.push_back(z);
        ys.push_back(expected_peak * std::exp(-0.5 * z * z));
      }
      plot.line(xs, ys, {palette::kBlack, 1.4, {}});
    }
  };
  return figure;
}

Figure residual_course(const FigureContext& context) {
  const bool with_temperature = std::any_of(
      context.calibration->pose_results.begin(), context.calibration->pose_results.end(),
      [](const PoseResult& p) { return std::isfinite(p.temp_C); });
  Figure figure;
  figure.caption =
      with_temperature
          ? context.tr(
                "Residual of every pose against the time of the run and against temperature.")
          : context.tr("Residual of every pose against the time of the run.");
  figure.description = context.tr("Residuals against time and temperature");
  figure.width = kFigureWidth;
  constexpr double kPanelHeight = 84, kStepY = 106, kTop = 24;
  figure.height = kTop + 3 * kStepY + 30;
  figure.draw = [context, with_temperature](Canvas& canvas) {
    const Calibration& calibration = *context.calibration;
    const double scale = nice_ceiling(largest_residual(calibration, false));
    std::vector<double> time_min, temp_C;
    for (const PoseResult& p : calibration.pose_results) {
      time_min.push_back(p.t_mean_s / 60);
      temp_C.push_back(p.temp_C);
    }
    if (time_min.empty()) return;
    const double width = with_temperature ? 380 : kFigureWidth - 76;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      std::vector<double> residual;
      for (const PoseResult& p : calibration.pose_results) {
        residual.push_back(p.residual_after_mps2[i]);
      }
      const double top = kTop + static_cast<double>(i) * kStepY;
      const auto [t_low, t_high] = range(time_min);
      PlotAxis y{i == 1 ? context.tr("residual, m/s²") : "", -scale, scale};
      y.ticks = 4;
      PlotAxis x{i == 2 ? context.tr("time, min") : "", t_low, t_high};
      x.tick_labels = i == 2;
      Plot course(canvas, {60, top}, width, kPanelHeight, x, y);
      course.draw_frame(context.tr("{} axis", kAxisName[i]));
      course.points(time_min, residual, 1.6, kAxisColor[i]);
      if (!with_temperature) continue;
      const auto [c_low, c_high] = range(temp_C);
      PlotAxis temperature{i == 2 ? context.tr("temperature, °C") : "", c_low, c_high};
      temperature.tick_labels = i == 2;
      y.label.clear();
      y.tick_labels = false;
      Plot other(canvas, {60 + width + 24, top}, kFigureWidth - 60 - width - 24 - 16, kPanelHeight,
                 temperature, y);
      other.draw_frame();
      other.points(temp_C, residual, 1.6, kAxisColor[i]);
    }
  };
  return figure;
}

std::optional<Figure> fitted_terms_figure(const FigureContext& context) {
  constexpr std::size_t kMost = 6, kColumns = 2;
  constexpr double kPanelWidth = 270, kPanelHeight = 120, kStepX = 345, kStepY = 188, kTop = 26;
  const std::size_t count = std::min(kMost, context.calibration->fitted_terms.size());
  if (count == 0) return std::nullopt;
  Figure figure;
  figure.caption = context.tr(
      "Residual with one added effect left out of the model (coloured) and the fitted term of that "
      "effect (black), against the recorded variable that shows it best; the axis on which it is "
      "largest.");
  figure.description = context.tr("Residuals against the driver of each added effect");
  figure.width = kFigureWidth;
  const std::size_t rows = (count + kColumns - 1) / kColumns;
  figure.height = kTop + static_cast<double>(rows) * kStepY - 14;
  figure.draw = [context, count](Canvas& canvas) {
    const Calibration& calibration = *context.calibration;
    for (std::size_t k = 0; k < count; ++k) {
      const FittedTerm& term = calibration.fitted_terms[k];
      const std::size_t row = k / kColumns;
      std::vector<double> residual;
      for (std::size_t p = 0; p < term.term_mps2.size(); ++p)
        residual.push_back(term.term_mps2[p] +
                           calibration.pose_results[p].residual_after_mps2[term.axis]);
      std::vector<double> shown = residual;
      shown.insert(shown.end(), term.term_mps2.begin(), term.term_mps2.end());
      const auto [left, right] = range(term.at);
      const auto [low, high] = range(shown);
      PlotAxis x{term.driver, left, right};
      x.ticks = 6;
      PlotAxis y{k % kColumns == 0 ? context.tr("residual, m/s²") : "", low, high};
      y.ticks = 4;
      Plot plot(canvas,
                {60 + static_cast<double>(k % kColumns) * kStepX,
                 kTop + static_cast<double>(row) * kStepY},
                kPanelWidth, kPanelHeight, x, y);
      plot.draw_frame(context.tr("{} axis", kAxisName[term.axis]) + ": " +
                      shortened(term.name, kLongestTitle));
      plot.points(term.at, residual, 1.6, kAxisColor[term.axis]);
      plot.points(term.at, term.term_mps2, 1.0, palette::kBlack);
    }
  };
  return figure;
}

}  // namespace plumbline::app
