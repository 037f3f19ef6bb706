#include "app/figure/allan_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "app/figure/plot.h"
#include "app/figure/svg_canvas.h"
#include "estimator/noise/record_terms.h"

namespace plumbline::app {

namespace {

constexpr std::array kColors = {palette::kBlue, palette::kOrange, palette::kGreen};
/// Apart in black and white too.
const std::array<std::vector<double>, kColors.size()> kDashes = {
    std::vector<double>{}, std::vector<double>{7, 3}, std::vector<double>{2, 2.5}};
constexpr double kMarginLeft = 62, kMarginRight = 14, kMarginTop = 30, kMarginBottom = 42;

/// Whole decades around all positive values; one decade when there is none.
PlotAxis decades(const std::string& label, const std::vector<double>& values) {
  double min = std::numeric_limits<double>::infinity();
  double max = 0;
  for (const double value : values) {
    if (!std::isfinite(value) || value <= 0) continue;
    min = std::min(min, value);
    max = std::max(max, value);
  }
  PlotAxis axis{.label = label, .min = 1, .max = 10, .kind = ScaleKind::logarithmic};
  if (max == 0) return axis;
  axis.min = std::pow(10.0, std::floor(std::log10(min)));
  axis.max = std::pow(10.0, std::ceil(std::log10(max)));
  if (axis.max <= axis.min) axis.max = 10 * axis.min;
  return axis;
}

/// Few differences leave no finite upper limit; the band then ends at the value itself.
std::vector<double> drawable_upper(const DeviationCurve& curve) {
  std::vector<double> upper = curve.upper;
  for (std::size_t i = 0; i < upper.size(); ++i) {
    if (!std::isfinite(upper[i])) upper[i] = curve.value[i];
  }
  return upper;
}

void append(std::vector<double>& all, const std::vector<double>& some) {
  all.insert(all.end(), some.begin(), some.end());
}

/// Where the name of a curve stands: at the end at which it is higher, for its middle lies among
/// the others.
std::size_t place_of_name(const std::vector<double>& curve) {
  return curve.front() >= curve.back() ? 0 : curve.size() - 1;
}

}  // namespace

std::vector<AllanTerm> allan_terms(const NoiseModel& noise) {
  RecordTerms shown = noise.record;
  shown.term = reported_terms(noise);
  std::vector<AllanTerm> curves;
  std::vector<std::size_t> present;
  for (std::size_t term = 0; term < kTermCount; ++term) {
    if (!shown.term[term].present) continue;
    present.push_back(term);
    curves.push_back({kTermName[term], {}});
  }
  for (std::size_t m = 0; m < shown.markov.size(); ++m) curves.push_back({"M", {}});
  for (const double tau_s : noise.oadev.tau_s) {
    const AllanParts parts = allan_parts_of(shown, tau_s);
    std::size_t curve = 0;
    for (const std::size_t term : present)
      curves[curve++].value.push_back(std::sqrt(parts.term[term]));
    for (const double part : parts.markov) curves[curve++].value.push_back(std::sqrt(part));
  }
  return curves;
}

void draw_allan_panels(Canvas& canvas, Point top_left, double width, double height,
                       const std::vector<AllanSeries>& series, const AllanLabels& labels) {
  if (series.empty()) return;
  constexpr double kGap = 30, kTop = 22, kRight = 12, kNameSize = 10;
  std::vector<double> taus, values;
  for (const AllanSeries& s : series) {
    append(taus, s.noise->oadev.tau_s);
    append(values, s.noise->oadev.value);
    append(values, s.noise->oadev.lower);
    append(values, drawable_upper(s.noise->oadev));
  }
  PlotAxis x = decades(labels.tau, taus), y = decades(labels.deviation, values);
  const auto count = static_cast<double>(series.size());
  const double panel = (width - kMarginLeft - kRight - (count - 1) * kGap) / count;
  double left = top_left.x + kMarginLeft;
  for (const AllanSeries& s : series) {
    const DeviationCurve& curve = s.noise->oadev;
    Plot plot(canvas, {left, top_left.y + kTop}, panel, height - kTop - kMarginBottom, x, y);
    plot.draw_frame(s.label);
    for (const AllanTerm& term : allan_terms(*s.noise)) {
      plot.line(curve.tau_s, term.value, {palette::kBlack, 0.7, {4, 2.5}});
      const std::size_t k = place_of_name(term.value);
      const Point at = plot.at(curve.tau_s[k], std::clamp(term.value[k], y.min, y.max));
      const bool first = k == 0;
      // Above its curve, to the right of one that falls; within the frame.
      const double baseline = std::max(at.y - 4, top_left.y + kTop + kNameSize + 1);
      canvas.text({at.x + (first ? 9 : -3), baseline}, term.name,
                  {kNameSize, first ? Anchor::start : Anchor::end, 0, true});
    }
    if (s.noise->fitted.size() == curve.tau_s.size()) {
      plot.line(curve.tau_s, s.noise->fitted, {palette::kOrange, 1.6, {}});
    }
    if (curve.lower.size() == curve.tau_s.size() && curve.upper.size() == curve.tau_s.size()) {
      const std::vector<double> upper = drawable_upper(curve);
      for (std::size_t k = 0; k < upper.size(); ++k) {
        plot.line({curve.tau_s[k], curve.tau_s[k]}, {curve.lower[k], upper[k]},
                  {palette::kBlue, 1, {}});
      }
    }
    plot.points(curve.tau_s, curve.value, 2.2, palette::kBlue);
    y.label.clear();
    y.tick_labels = false;
    left += panel + kGap;
  }
}

void draw_allan(Canvas& canvas, Point top_left, double width, double height,
                const std::vector<AllanSeries>& series, const AllanLabels& labels) {
  std::vector<double> taus;
  std::vector<double> values;
  for (const AllanSeries& s : series) {
    append(taus, s.noise->oadev.tau_s);
    append(values, s.noise->oadev.value);
    append(values, s.noise->oadev.lower);
  }
  Plot plot(canvas, {top_left.x + kMarginLeft, top_left.y + kMarginTop},
            width - kMarginLeft - kMarginRight, height - kMarginTop - kMarginBottom,
            decades(labels.tau, taus), decades(labels.deviation, values));
  plot.draw_frame();
  std::vector<LegendEntry> legend;
  for (std::size_t i = 0; i < series.size(); ++i) {
    const NoiseModel& noise = *series[i].noise;
    const std::string color = kColors[i % kColors.size()];
    if (noise.oadev.lower.size() == noise.oadev.tau_s.size() &&
        noise.oadev.upper.size() == noise.oadev.tau_s.size()) {
      plot.band(noise.oadev.tau_s, noise.oadev.lower, drawable_upper(noise.oadev), color, 0.2);
    }
    plot.points(noise.oadev.tau_s, noise.oadev.value, 2, color);
    const Stroke stroke{color, 1.4, kDashes[i % kDashes.size()]};
    if (noise.fitted.size() == noise.oadev.tau_s.size()) {
      plot.line(noise.oadev.tau_s, noise.fitted, stroke);
    }
    legend.push_back({series[i].label, stroke, {}});
  }
  draw_legend(canvas, {top_left.x + kMarginLeft, top_left.y + 18}, legend);
}

std::string allan_svg(const std::vector<AllanSeries>& series, const std::string& unit) {
  constexpr double kWidth = 720, kHeight = 480;
  SvgCanvas canvas(kWidth, kHeight);
  canvas.rectangle({0, 0}, kWidth, kHeight, "#ffffff");
  draw_allan(canvas, {0, 0}, kWidth, kHeight, series,
             {.deviation = "overlapping Allan deviation, " + unit});
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n" +
         canvas.svg("allan", "Overlapping Allan deviation against averaging time");
}

}  // namespace plumbline::app
