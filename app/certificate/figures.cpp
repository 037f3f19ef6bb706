#include "app/certificate/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "app/figure/plot.h"

namespace plumbline::app {
namespace {

constexpr double kWidth = 700;

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
const std::array<std::vector<double>, kAxisCount> kAxisDash = {
    std::vector<double>{}, std::vector<double>{7, 3}, std::vector<double>{2, 2.5}};

/// Smallest of 1, 2, 5 × a power of ten that is not below `value`.
double nice_ceiling(double value) {
  if (!(value > 0)) return 1;
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (double step : {1.0, 1.5, 2.0, 3.0, 5.0, 7.0}) {
    if (step * power >= value * (1 - 1e-9)) return step * power;
  }
  return 10 * power;
}

double largest_residual(const Calibration& calibration) {
  double largest = 0;
  for (const PoseResult& pose : calibration.pose_results) {
    for (double r : pose.residual_after_mps2) largest = std::max(largest, std::abs(r));
  }
  return largest;
}

double span_or(double step, double fallback) { return step > 0 ? step : fallback; }

// + or − in a cell whose residual exceeds twice what is expected: the sign survives without colour.
void draw_sign(Canvas& canvas, Point centre, double size, bool positive) {
  const Stroke mark{palette::kBlack, 0.9, {}};
  canvas.line({centre.x - size, centre.y}, {centre.x + size, centre.y}, mark);
  if (positive) canvas.line({centre.x, centre.y - size}, {centre.x, centre.y + size}, mark);
}

void draw_color_bar(Canvas& canvas, Point top_left, double width, double scale) {
  constexpr int kSteps = 60;
  for (int i = 0; i < kSteps; ++i) {
    canvas.rectangle({top_left.x + width * i / kSteps, top_left.y}, width / kSteps + 0.5, 10,
                     diverging(2.0 * (i + 0.5) / kSteps - 1));
  }
  PlotAxis axis{"residual, m/s²", -scale, scale};
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

Figure residual_map(const Calibration& calibration, const Grid& grid) {
  Figure figure;
  figure.caption =
      "Residual of every pose over δ and h, one colour scale for the three axes. Cells beyond "
      "twice "
      "the expected residual carry their sign.";
  figure.description = "Maps of the residual over spindle angle and tilt for the axes x, y and z";
  figure.width = kWidth;
  const double cell_delta = span_or(grid.delta.step_deg, 10), cell_h = span_or(grid.h.step_deg, 10);
  constexpr double kMapHeight = 130, kGap = 34, kTop = 22;
  figure.height = kTop + 3 * (kMapHeight + kGap) + 62;
  figure.draw = [calibration, cell_delta, cell_h](Canvas& canvas) {
    double h_low = 1e9, h_high = -1e9, d_low = 1e9, d_high = -1e9;
    for (const PoseResult& p : calibration.pose_results) {
      h_low = std::min(h_low, p.pose.h_deg);
      h_high = std::max(h_high, p.pose.h_deg);
      d_low = std::min(d_low, p.pose.delta_deg);
      d_high = std::max(d_high, p.pose.delta_deg);
    }
    if (calibration.pose_results.empty()) return;
    const double scale = nice_ceiling(largest_residual(calibration));
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const double top = kTop + static_cast<double>(i) * (kMapHeight + kGap);
      PlotAxis x{i == 2 ? "δ, degrees" : "", d_low - cell_delta / 2, d_high + cell_delta / 2};
      x.ticks = 12;
      PlotAxis y{"h, degrees", h_low - cell_h / 2, h_high + cell_h / 2};
      y.ticks = 5;
      Plot plot(canvas, {58, top}, kWidth - 58 - 12, kMapHeight, x, y);
      plot.draw_frame(fmt::format("{} axis", kAxisName[i]));
      for (const PoseResult& p : calibration.pose_results) {
        const double r = p.residual_after_mps2[i];
        const Point a = plot.at(p.pose.delta_deg - cell_delta / 2, p.pose.h_deg + cell_h / 2);
        const Point b = plot.at(p.pose.delta_deg + cell_delta / 2, p.pose.h_deg - cell_h / 2);
        canvas.rectangle(a, b.x - a.x, b.y - a.y, diverging(r / scale));
        if (std::abs(r) > 2 * calibration.floor_pose_rms_mps2[i]) {
          draw_sign(canvas, {(a.x + b.x) / 2, (a.y + b.y) / 2}, 2.5, r > 0);
        }
      }
    }
    draw_color_bar(canvas, {180, kTop + 3 * (kMapHeight + kGap) + 16}, 320, scale);
  };
  return figure;
}

Figure residual_histogram(const Calibration& calibration) {
  Figure figure;
  figure.caption =
      "Residuals of the poses in units of what the identified noise alone would leave (bars), and "
      "the normal distribution that they should follow (line).";
  figure.description = "Histograms of the normalised residuals for the axes x, y and z";
  figure.width = kWidth;
  figure.height = 230;
  figure.draw = [calibration](Canvas& canvas) {
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
      PlotAxis x{"residual / expected", -kRange, kRange};
      PlotAxis y{i == 0 ? "poses" : "", 0, top};
      Plot plot(canvas, {52 + static_cast<double>(i) * 222, 26}, 190, 150, x, y);
      plot.draw_frame(outside == 0 ? fmt::format("{} axis", kAxisName[i])
                                   : fmt::format("{} axis ({} beyond ±5)", kAxisName[i], outside));
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

Figure allan_figure(const Calibration& calibration) {
  Figure figure;
  figure.caption =
      "Overlapping Allan deviation of each output, input-referred (points, with 95 % limits), and "
      "the sum of the identified noise terms (lines).";
  figure.description = "Allan deviation against averaging time for the axes x, y and z";
  figure.width = kWidth;
  figure.height = 330;
  figure.draw = [calibration](Canvas& canvas) {
    double t_low = 1e300, t_high = 0, v_low = 1e300, v_high = 0;
    const auto scale_of = [&](std::size_t i) {
      return kStandardGravity_mps2 /
             std::abs(calibration.final.batch_ls[i].value(static_cast<Eigen::Index>(i)));
    };
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const DeviationCurve& curve = calibration.noise[i].oadev;
      for (std::size_t k = 0; k < curve.tau_s.size(); ++k) {
        if (!(curve.value[k] > 0)) continue;
        t_low = std::min(t_low, curve.tau_s[k]);
        t_high = std::max(t_high, curve.tau_s[k]);
        v_low = std::min(v_low, curve.value[k] * scale_of(i));
        v_high = std::max(v_high, curve.value[k] * scale_of(i));
      }
    }
    if (!(t_high > t_low) || !(v_high > 0)) {
      canvas.text({kWidth / 2, 160}, "no static record long enough for an Allan deviation",
                  {12, Anchor::middle});
      return;
    }
    PlotAxis x{"averaging time τ, s", t_low / 1.3, t_high * 1.3, ScaleKind::logarithmic};
    PlotAxis y{"Allan deviation, m/s²", v_low / 2, v_high * 1.6, ScaleKind::logarithmic};
    Plot plot(canvas, {66, 34}, kWidth - 66 - 20, 232, x, y);
    plot.draw_frame();
    std::vector<LegendEntry> legend;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const NoiseModel& noise = calibration.noise[i];
      const auto scaled = [&](std::vector<double> values) {
        for (double& value : values) value *= scale_of(i);
        return values;
      };
      const DeviationCurve& curve = noise.oadev;
      if (curve.lower.size() == curve.tau_s.size() && curve.upper.size() == curve.tau_s.size()) {
        plot.band(curve.tau_s, scaled(curve.lower), scaled(curve.upper), kAxisColor[i], 0.15);
      }
      plot.points(curve.tau_s, scaled(curve.value), 2.2, kAxisColor[i]);
      const Stroke stroke{kAxisColor[i], 1.5, kAxisDash[i]};
      if (noise.fitted.size() == curve.tau_s.size()) {
        plot.line(curve.tau_s, scaled(noise.fitted), stroke);
      }
      legend.push_back({fmt::format("{} axis", kAxisName[i]), stroke, ""});
    }
    draw_legend(canvas, {70, 22}, legend);
  };
  return figure;
}

Figure convergence_figure(const Calibration& calibration) {
  Figure figure;
  figure.caption =
      "Estimate of each parameter against the number of positions, as difference from the final "
      "least-squares value; the grey band is the final standard uncertainty times two.";
  figure.description = "Convergence of recursive least squares, filter and batch least squares";
  figure.width = kWidth;
  constexpr double kPanelWidth = 112, kPanelHeight = 92, kStepX = 164, kStepY = 136, kTop = 50;
  figure.height = kTop + 3 * kStepY - 4;
  figure.draw = [calibration](Canvas& canvas) {
    const Convergence& run = calibration.convergence;
    const std::size_t count = std::max({run.rls.size(), run.ekf.size(), run.batch_ls.size()});
    if (count < 2) return;
    draw_legend(canvas, {52, 18},
                {{"recursive least squares", {palette::kBlue, 1.5, {}}, ""},
                 {"eight-state filter", {palette::kOrange, 1.5, {6, 3}}, ""},
                 {"batch least squares", {palette::kBlack, 1.2, {1.5, 2}}, ""}});
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      for (Eigen::Index j = 0; j < 4; ++j) {
        const AxisEstimate& final = calibration.estimates.batch_ls[i];
        const double reference = final.value(j);
        const double two_u = 2 * std::sqrt(final.covariance(j, j));
        const auto curve = [&](const std::vector<TriadEstimate>& history) {
          std::vector<double> values;
          values.reserve(history.size());
          for (const TriadEstimate& e : history)
            values.push_back(1e3 * (e[i].value(j) - reference));
          return values;
        };
        const auto rls = curve(run.rls), ekf = curve(run.ekf), batch = curve(run.batch_ls);
        // The first positions would flatten everything that matters; the panel shows what follows.
        double half = 4e3 * two_u / 2;
        for (const auto* values : {&rls, &ekf}) {
          for (std::size_t k = count / 4; k < values->size(); ++k) {
            half = std::max(half, 1.2 * std::abs((*values)[k]));
          }
        }
        if (!(half > 0)) half = 1;
        PlotAxis x{i == 2 ? "positions" : "", 0, static_cast<double>(count)};
        x.ticks = 3;
        PlotAxis y{j == 0 ? "difference, mV/g" : j == 3 ? "difference, mV" : "", -half, half};
        y.ticks = 4;
        Plot plot(canvas,
                  {62 + (j == 3 ? 24 : 0) + static_cast<double>(j) * kStepX,
                   kTop + static_cast<double>(i) * kStepY},
                  kPanelWidth, kPanelHeight, x, y);
        plot.draw_frame(
            j == 3 ? fmt::format("U_{}0", kAxisName[i])
                   : fmt::format("K_{}{}", kAxisName[i], kAxisName[static_cast<std::size_t>(j)]));
        plot.band({0, static_cast<double>(count)}, {-1e3 * two_u, -1e3 * two_u},
                  {1e3 * two_u, 1e3 * two_u}, palette::kGrey, 0.25);
        const auto positions = [](std::size_t n) {
          std::vector<double> values(n);
          for (std::size_t k = 0; k < n; ++k) values[k] = static_cast<double>(k + 1);
          return values;
        };
        plot.line(positions(rls.size()), rls, {palette::kBlue, 1.4, {}});
        plot.line(positions(ekf.size()), ekf, {palette::kOrange, 1.4, {6, 3}});
        plot.line(positions(batch.size()), batch, {palette::kBlack, 1.1, {1.5, 2}});
      }
    }
  };
  return figure;
}

Figure residual_course(const Calibration& calibration) {
  const bool with_temperature =
      std::any_of(calibration.pose_results.begin(), calibration.pose_results.end(),
                  [](const PoseResult& p) { return std::isfinite(p.temp_C); });
  Figure figure;
  figure.caption =
      with_temperature
          ? "Residual of every pose against the time of the run and against temperature."
          : "Residual of every pose against the time of the run.";
  figure.description = "Residuals against time and temperature";
  figure.width = kWidth;
  constexpr double kPanelHeight = 84, kStepY = 106, kTop = 24;
  figure.height = kTop + 3 * kStepY + 30;
  figure.draw = [calibration, with_temperature](Canvas& canvas) {
    const double scale = nice_ceiling(largest_residual(calibration));
    std::vector<double> time_min, temp_C;
    for (const PoseResult& p : calibration.pose_results) {
      time_min.push_back(p.t_mean_s / 60);
      temp_C.push_back(p.temp_C);
    }
    if (time_min.empty()) return;
    const auto range = [](const std::vector<double>& values) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (double value : values) {
        if (!std::isfinite(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
      }
      const double margin = std::max(0.03 * (high - low), 1e-3 * std::max(1.0, std::abs(high)));
      return std::pair(low - margin, high + margin);
    };
    const double width = with_temperature ? 380 : kWidth - 76;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      std::vector<double> residual;
      for (const PoseResult& p : calibration.pose_results) {
        residual.push_back(p.residual_after_mps2[i]);
      }
      const double top = kTop + static_cast<double>(i) * kStepY;
      const auto [t_low, t_high] = range(time_min);
      PlotAxis y{i == 1 ? "residual, m/s²" : "", -scale, scale};
      y.ticks = 4;
      PlotAxis x{i == 2 ? "time, min" : "", t_low, t_high};
      x.tick_labels = i == 2;
      Plot course(canvas, {60, top}, width, kPanelHeight, x, y);
      course.draw_frame(fmt::format("{} axis", kAxisName[i]));
      course.points(time_min, residual, 1.6, kAxisColor[i]);
      if (!with_temperature) continue;
      const auto [c_low, c_high] = range(temp_C);
      PlotAxis temperature{i == 2 ? "temperature, °C" : "", c_low, c_high};
      temperature.tick_labels = i == 2;
      y.label.clear();
      y.tick_labels = false;
      Plot other(canvas, {60 + width + 24, top}, kWidth - 60 - width - 24 - 16, kPanelHeight,
                 temperature, y);
      other.draw_frame();
      other.points(temp_C, residual, 1.6, kAxisColor[i]);
    }
  };
  return figure;
}

}  // namespace plumbline::app
