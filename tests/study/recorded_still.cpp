// The page on two records at rest: a periodic disturbance found in one, tested on the other.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "app/figure/plot.h"
#include "app/figure/svg_canvas.h"
#include "estimator/noise/identify.h"
#include "estimator/noise/spectrum.h"
#include "tests/study/recorded.h"

namespace plumbline::study {
namespace {

using app::LegendEntry;
using app::Plot;
using app::Stroke;
using app::SvgCanvas;
namespace palette = app::palette;

constexpr double kBlock_s = 0.1;  ///< samples are averaged over that long first
constexpr double kLeftOut_s = 1;  ///< predicted from what lies on both sides
constexpr double kFlanks_s[] = {4, 8, 16, 32};

/// Power per Hz of a record, from its cosine spectrum.
struct Spectrum {
  std::vector<double> power;  ///< squared coefficients
  double step_hz = 0;

  Spectrum(const std::vector<double>& record, double rate_hz) {
    for (const double c : cosine_transform(record)) power.push_back(c * c);
    step_hz = rate_hz / (2 * static_cast<double>(power.size()));
  }
  /// Mean square of the record between two frequencies.
  double between(double from_hz, double to_hz) const {
    const auto last = static_cast<std::size_t>(to_hz / step_hz);
    double sum = 0;
    for (auto k = static_cast<std::size_t>(from_hz / step_hz) + 1; k <= last && k < power.size();
         ++k)
      sum += power[k];
    return sum / static_cast<double>(power.size());
  }
};

/// A frequency range about a line, and what its flanks on either side let expect in it.
struct Band {
  double from_hz, to_hz;

  explicit Band(const SpectralLine& line) {
    const double half_hz = std::max(3 * line.width_hz, 0.01);
    from_hz = std::max(0.0, line.f_hz - half_hz);
    to_hz = line.f_hz + half_hz;
  }
  double background(const Spectrum& spectrum) const {
    const double width_hz = to_hz - from_hz;
    return 0.5 * (spectrum.between(std::max(0.0, from_hz - width_hz), from_hz) +
                  spectrum.between(to_hz, to_hz + width_hz));
  }
};

std::string lines_table(const StillRecords& records, const PerAxis<NoiseModel>& noise) {
  std::vector<std::vector<std::string>> rows = {
      {"axis", "line in the first record, Hz", "amplitude, mm/s²",
       "left-out record, RMS in that band, mm/s²: measured", "expected without the line (before)",
       "expected with it (after)"}};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    if (noise[i].record.lines.empty()) continue;
    const Spectrum fitted(records.fitted_mps2[i], records.rate_hz);
    const Spectrum left_out(records.left_out_mps2[i], records.rate_hz);
    for (const SpectralLine& line : noise[i].record.lines) {
      const Band band(line);
      const double without = band.background(fitted);
      const double with = without + 0.5 * line.amplitude * line.amplitude;
      rows.push_back(
          {kAxisName[i],
           fmt::format("{:.4f} ± {:.4f}{}{}", line.f_hz, line.u_f_hz,
                       line.width_hz > 0 ? fmt::format(", {:.3f} wide", line.width_hz) : "",
                       line.harmonic > 1 ? fmt::format(", harmonic {}", line.harmonic) : ""),
           fmt::format("{:.2f} ± {:.2f}", kMilli * line.amplitude, kMilli * line.u),
           fmt::format("{:.2f}", kMilli * std::sqrt(left_out.between(band.from_hz, band.to_hz))),
           fmt::format("{:.2f}", kMilli * std::sqrt(without)),
           fmt::format("{:.2f}", kMilli * std::sqrt(with))});
    }
  }
  return html_table(rows);
}

std::vector<double> block_means(const std::vector<double>& record, double rate_hz) {
  const auto size = static_cast<std::size_t>(std::lround(kBlock_s * rate_hz));
  std::vector<double> means;
  for (std::size_t first = 0; first + size <= record.size(); first += size) {
    double sum = 0;
    for (std::size_t k = first; k < first + size; ++k) sum += record[k];
    means.push_back(sum / static_cast<double>(size));
  }
  return means;
}

/// A constant and a wave with its harmonics at the given times.
Eigen::MatrixXd wave_columns(const Eigen::VectorXd& t_s, double f_hz,
                             const std::vector<int>& orders) {
  Eigen::MatrixXd A(t_s.size(), 1 + 2 * std::ssize(orders));
  A.col(0).setOnes();
  for (std::size_t k = 0; k < orders.size(); ++k) {
    const Eigen::ArrayXd phase = 2 * std::numbers::pi * f_hz * orders[k] * t_s.array();
    A.col(1 + 2 * static_cast<Eigen::Index>(k)) = phase.cos();
    A.col(2 + 2 * static_cast<Eigen::Index>(k)) = phase.sin();
  }
  return A;
}

struct Prediction {
  double before_mps2 = 0;  ///< RMS of what is left out about the mean of its neighbourhood
  double after_mps2 = 0;   ///< about the wave that the neighbourhood shows
};

/// Leaves out a second every five, and predicts it from `flank_s` on either side: by their mean,
/// and by the wave, its frequency sought there within the line's width.
Prediction predict(const std::vector<double>& blocks, const SpectralLine& line,
                   const std::vector<int>& orders, double flank_s) {
  const auto flank = static_cast<Eigen::Index>(flank_s / kBlock_s);
  const auto middle = static_cast<Eigen::Index>(kLeftOut_s / kBlock_s);
  const Eigen::Index length = 2 * flank + middle;
  const Eigen::VectorXd t_s =
      Eigen::VectorXd::LinSpaced(length, 0, kBlock_s * static_cast<double>(length - 1));
  Eigen::VectorXd t_flanks(2 * flank);
  t_flanks << t_s.head(flank), t_s.tail(flank);
  struct Wave {
    Eigen::MatrixXd gain, seen, middle;
  };
  std::vector<Wave> waves;
  const double reach_hz = std::max(1.5 * line.width_hz, 0.01);
  for (int k = -6; k <= 6; ++k) {
    const double f_hz = line.f_hz + reach_hz * k / 6;
    const Eigen::MatrixXd seen = wave_columns(t_flanks, f_hz, orders);
    waves.push_back({seen.completeOrthogonalDecomposition().pseudoInverse(), seen,
                     wave_columns(t_s.segment(flank, middle), f_hz, orders)});
  }
  double before = 0, after = 0, count = 0;
  const Eigen::Map<const Eigen::VectorXd> all(blocks.data(), std::ssize(blocks));
  for (Eigen::Index first = 0; first + length <= all.size(); first += 5 * middle) {
    Eigen::VectorXd y(2 * flank);
    y << all.segment(first, flank), all.segment(first + flank + middle, flank);
    const Eigen::VectorXd left_out = all.segment(first + flank, middle);
    double best = std::numeric_limits<double>::infinity();
    Eigen::VectorXd predicted;
    for (const Wave& wave : waves) {
      const Eigen::VectorXd coefficient = wave.gain * y;
      const double rest = (y - wave.seen * coefficient).squaredNorm();
      if (rest >= best) continue;
      best = rest;
      predicted = wave.middle * coefficient;
    }
    before += (left_out.array() - y.mean()).square().sum();
    after += (left_out - predicted).squaredNorm();
    count += static_cast<double>(middle);
  }
  return {std::sqrt(before / count), std::sqrt(after / count)};
}

/// The strongest line of an axis, taken off seconds of the left-out record that it was not fitted
/// to.
struct TakenOff {
  std::size_t axis = 0;
  SpectralLine line;
  std::vector<int> orders;
  double flank_s = 0;
  Prediction tested;
  double white_mps2 = 0;  ///< of the same means
};
std::vector<TakenOff> take_off(const StillRecords& records, const PerAxis<NoiseModel>& noise) {
  std::vector<TakenOff> all;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto& lines = noise[i].record.lines;
    if (lines.empty()) continue;
    const SpectralLine& line = lines.front();
    std::vector<int> orders = {1};
    for (const SpectralLine& other : lines)
      if (other.harmonic > 1 && std::abs(other.fundamental_hz - line.f_hz) < 0.02)
        orders.push_back(other.harmonic);
    const std::vector<double> fitted = block_means(records.fitted_mps2[i], records.rate_hz);
    const std::vector<double> left_out = block_means(records.left_out_mps2[i], records.rate_hz);
    double flank_s = kFlanks_s[0];
    double least = std::numeric_limits<double>::infinity();
    for (const double candidate_s : kFlanks_s) {  // chosen on the first record
      const double error = predict(fitted, line, orders, candidate_s).after_mps2;
      if (error >= least) continue;
      least = error;
      flank_s = candidate_s;
    }
    all.push_back({i, line, orders, flank_s, predict(left_out, line, orders, flank_s),
                   noise[i].record.term[kTermN].value / std::sqrt(kBlock_s)});
  }
  return all;
}

std::string prediction_table(const std::vector<TakenOff>& all) {
  std::vector<std::vector<std::string>> rows = {
      {"axis", "wave", "neighbourhood, s each side",
       "left-out seconds of the left-out record, means of 0.1 s: before, mm/s² RMS", "after",
       "white noise of such means alone"}};
  for (const TakenOff& t : all) {
    rows.push_back({kAxisName[t.axis],
                    fmt::format("{:.3f} Hz, orders {}", t.line.f_hz, fmt::join(t.orders, ", ")),
                    fmt::format("{:.0f}", t.flank_s), mm(t.tested.before_mps2),
                    mm(t.tested.after_mps2), mm(t.white_mps2)});
  }
  return html_table(rows);
}

std::string in_words(const std::vector<TakenOff>& all) {
  if (all.empty()) return "<p>No axis shows a periodic line.</p>\n";
  std::string text;
  for (const TakenOff& t : all) {
    text += fmt::format(
        "{} axis: a wave of {:.3f} Hz, amplitude ({} ± {}) mm/s². With it the error of seconds "
        "that "
        "were left out goes from {} to {} mm/s², where white noise alone leaves {}. ",
        kAxisName[t.axis], t.line.f_hz, mm(t.line.amplitude), mm(t.line.u),
        mm(t.tested.before_mps2), mm(t.tested.after_mps2), mm(t.white_mps2));
  }
  const bool wanders =
      std::any_of(all.begin(), all.end(), [](const TakenOff& t) { return t.line.width_hz > 0; });
  if (wanders)
    text += "It keeps no phase for long, so that it can be taken off only near where it is seen. ";
  return "<p>" + text + "What drives it was not recorded.</p>\n";
}

std::string spectrum_figure(const StillRecords& records, std::size_t axis) {
  const Spectrum fitted(records.fitted_mps2[axis], records.rate_hz);
  const Spectrum left_out(records.left_out_mps2[axis], records.rate_hz);
  constexpr double kFrom_hz = 0.05, kTo_hz = 5, kRatio = 1.02;
  std::vector<double> f_hz, first, second;
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (double f = kFrom_hz; f < kTo_hz; f *= kRatio) {
    const auto density = [&](const Spectrum& spectrum) {
      const double value = kMilli * std::sqrt(spectrum.between(f, f * kRatio) / (f * kRatio - f));
      least = std::min(least, value);
      most = std::max(most, value);
      return value;
    };
    f_hz.push_back(f);
    first.push_back(density(fitted));
    second.push_back(density(left_out));
  }
  const std::string words = fmt::format("Spectrum of axis {}: both records", kAxisName[axis]);
  SvgCanvas canvas(760, 280);
  Plot plot(canvas, {80, 40}, 660, 190,
            {"frequency, Hz", kFrom_hz, kTo_hz, app::ScaleKind::logarithmic, true, 5},
            {"mm/s²/√Hz", 0.9 * least, 1.2 * most, app::ScaleKind::logarithmic, true, 5});
  plot.draw_frame();
  plot.line(f_hz, first, Stroke{palette::kBlue, 1.3, {}});
  plot.line(f_hz, second, Stroke{palette::kOrange, 1.3, {}});
  app::draw_legend(canvas, {85, 20},
                   {LegendEntry{"first record", Stroke{palette::kBlue, 2, {}}, {}},
                    LegendEntry{"left-out record", Stroke{palette::kOrange, 2, {}}, {}}});
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n",
                     canvas.svg(fmt::format("spectrum_{}", kAxisName[axis]), words), words);
}

}  // namespace

std::string still_page(const StillRecords& records) {
  PerAxis<NoiseModel> noise;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    noise[i] = identify_noise(records.fitted_mps2[i], records.rate_hz);
  std::string body =
      "<p>" + records.source + " Identified on the first record, tested on the second.</p>\n";
  std::vector<std::vector<std::string>> rows = {
      {"axis", "terms alone describe the first record", "with the lines", "remark"}};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const RecordTerms& terms = noise[i].record;
    const auto yes = [](bool adequate, double p) {
      return fmt::format("{} (p = {:.1g})", adequate ? "yes" : "no", p);
    };
    rows.push_back({kAxisName[i], yes(terms.adequate_without_lines, terms.p_value_without_lines),
                    yes(terms.adequate, terms.p_value), terms.remark});
  }
  body += "<h2>Do the noise terms describe the record?</h2>\n" + html_table(rows);
  body += "<h2>The lines, and what they predict for the left-out record</h2>\n" +
          lines_table(records, noise);
  for (std::size_t i = 0; i < kAxisCount; ++i) body += spectrum_figure(records, i);
  const std::vector<TakenOff> taken_off = take_off(records, noise);
  body +=
      "<h2>Can the wave be taken off?</h2>\n<p>One second in five is left out and predicted from "
      "what lies on both sides of it. How far to look was chosen on the first record.</p>\n" +
      prediction_table(taken_off) + "<h2>In words</h2>\n" + in_words(taken_off);
  return html_page(records.title, body);
}

}  // namespace plumbline::study
