#include "app/figure/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace plumbline::app {
namespace {

constexpr double kLabelSize = 11;
constexpr double kTickSize = 10;

double position(double value, const PlotAxis& axis) {
  if (axis.kind == ScaleKind::logarithmic) {
    // Values that a logarithmic axis cannot show lie far below it and are clipped away.
    if (value <= 0) return -10;
    return std::log10(value / axis.min) / std::log10(axis.max / axis.min);
  }
  return (value - axis.min) / (axis.max - axis.min);
}

const std::string kSuperscript[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};

std::string power_of_ten(int exponent) {
  std::string text = "10";
  if (exponent < 0) text += "⁻";
  for (char digit : fmt::format("{}", std::abs(exponent))) text += kSuperscript[digit - '0'];
  return text;
}

}  // namespace

std::vector<double> tick_positions(const PlotAxis& axis) {
  std::vector<double> ticks;
  if (axis.kind == ScaleKind::logarithmic) {
    const int first = static_cast<int>(std::ceil(std::log10(axis.min) - 1e-9));
    const int last = static_cast<int>(std::floor(std::log10(axis.max) + 1e-9));
    for (int e = first; e <= last; ++e) ticks.push_back(std::pow(10.0, e));
    return ticks;
  }
  const double raw = (axis.max - axis.min) / axis.ticks;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double mantissa = raw / power;
  const double step = power * (mantissa < 1.5 ? 1 : mantissa < 3.5 ? 2 : mantissa < 7.5 ? 5 : 10);
  const auto first = static_cast<long long>(std::ceil(axis.min / step - 1e-9));
  const auto last = static_cast<long long>(std::floor(axis.max / step + 1e-9));
  for (long long i = first; i <= last; ++i) ticks.push_back(static_cast<double>(i) * step);
  return ticks;
}

std::vector<std::string> tick_texts(const PlotAxis& axis, const std::vector<double>& ticks) {
  std::vector<std::string> texts;
  if (axis.kind == ScaleKind::logarithmic) {
    for (double tick : ticks) {
      texts.push_back(power_of_ten(static_cast<int>(std::lround(std::log10(tick)))));
    }
    return texts;
  }
  const double step =
      ticks.size() > 1 ? ticks[1] - ticks[0] : std::max(1e-300, axis.max - axis.min);
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  for (double tick : ticks) {
    std::string text =
        decimals > 7 ? fmt::format("{:.1e}", tick) : fmt::format("{:.{}f}", tick, decimals);
    if (text.find_first_not_of("-0.") == std::string::npos) text = "0";
    if (text.front() == '-') text.replace(0, 1, "−");
    texts.push_back(std::move(text));
  }
  return texts;
}

Plot::Plot(Canvas& canvas, Point top_left, double width, double height, PlotAxis x, PlotAxis y)
    : canvas_(canvas),
      top_left_(top_left),
      width_(width),
      height_(height),
      x_(std::move(x)),
      y_(std::move(y)) {
  assert(x_.max > x_.min && y_.max > y_.min);
}

double Plot::x_of(double value) const { return top_left_.x + width_ * position(value, x_); }
double Plot::y_of(double value) const { return top_left_.y + height_ * (1 - position(value, y_)); }
Point Plot::at(double x, double y) const { return {x_of(x), y_of(y)}; }

void Plot::draw_frame(const std::string& title) {
  const double left = top_left_.x, top = top_left_.y;
  const double right = left + width_, bottom = top + height_;
  const Stroke grid{palette::kLightGrey, 0.6, {}};
  const Stroke frame{palette::kBlack, 0.9, {}};

  const auto x_ticks = tick_positions(x_);
  const auto x_texts = tick_texts(x_, x_ticks);
  for (std::size_t i = 0; i < x_ticks.size(); ++i) {
    const double x = x_of(x_ticks[i]);
    canvas_.line({x, top}, {x, bottom}, grid);
    if (x_.tick_labels) {
      canvas_.text({x, bottom + kTickSize + 4}, x_texts[i], {kTickSize, Anchor::middle});
    }
  }
  const auto y_ticks = tick_positions(y_);
  const auto y_texts = tick_texts(y_, y_ticks);
  for (std::size_t i = 0; i < y_ticks.size(); ++i) {
    const double y = y_of(y_ticks[i]);
    canvas_.line({left, y}, {right, y}, grid);
    if (y_.tick_labels) {
      canvas_.text({left - 5, y + kTickSize * 0.35}, y_texts[i], {kTickSize, Anchor::end});
    }
  }
  canvas_.polyline({{left, top}, {right, top}, {right, bottom}, {left, bottom}, {left, top}},
                   frame);

  if (!x_.label.empty()) {
    canvas_.text({(left + right) / 2, bottom + kTickSize + kLabelSize + 10}, x_.label,
                 {kLabelSize, Anchor::middle});
  }
  if (!y_.label.empty()) {
    std::size_t longest = 0;
    for (const auto& text : y_texts) {
      const auto glyphs = static_cast<std::size_t>(
          std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
      longest = std::max(longest, glyphs);
    }
    const double offset =
        12 + (y_.tick_labels ? 0.56 * kTickSize * static_cast<double>(longest) : 0);
    canvas_.text({left - offset, (top + bottom) / 2}, y_.label, {kLabelSize, Anchor::middle, -90});
  }
  if (!title.empty()) {
    canvas_.text({(left + right) / 2, top - 6}, title, {kLabelSize, Anchor::middle, 0, true});
  }
}

void Plot::line(const std::vector<double>& x, const std::vector<double>& y, const Stroke& stroke) {
  assert(x.size() == y.size());
  std::vector<Point> path;
  canvas_.push_clip(top_left_, width_, height_);
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isfinite(y[i])) path.push_back(at(x[i], y[i]));
  }
  if (path.size() > 1) canvas_.polyline(path, stroke);
  canvas_.pop_clip();
}

void Plot::band(const std::vector<double>& x, const std::vector<double>& lower,
                const std::vector<double>& upper, const std::string& fill, double opacity) {
  assert(x.size() == lower.size() && x.size() == upper.size());
  std::vector<Point> outline;
  for (std::size_t i = 0; i < x.size(); ++i) outline.push_back(at(x[i], upper[i]));
  for (std::size_t i = x.size(); i-- > 0;) outline.push_back(at(x[i], lower[i]));
  if (outline.empty()) return;
  canvas_.push_clip(top_left_, width_, height_);
  canvas_.polygon(outline, fill, opacity);
  canvas_.pop_clip();
}

void Plot::points(const std::vector<double>& x, const std::vector<double>& y, double radius,
                  const std::string& fill) {
  assert(x.size() == y.size());
  canvas_.push_clip(top_left_, width_, height_);
  for (std::size_t i = 0; i < x.size(); ++i) canvas_.circle(at(x[i], y[i]), radius, fill, {});
  canvas_.pop_clip();
}

void Plot::bar(double x_from, double x_to, double y, const std::string& fill) {
  const Point a = at(x_from, y);
  const Point b = at(x_to, y_.min);
  canvas_.push_clip(top_left_, width_, height_);
  canvas_.rectangle(a, b.x - a.x, b.y - a.y, fill);
  canvas_.pop_clip();
}

void draw_legend(Canvas& canvas, Point at, const std::vector<LegendEntry>& entries) {
  double x = at.x;
  for (const LegendEntry& entry : entries) {
    if (entry.fill.empty()) {
      canvas.line({x, at.y - 4}, {x + 24, at.y - 4}, entry.stroke);
    } else {
      canvas.rectangle({x, at.y - 9}, 24, 10, entry.fill, entry.opacity);
    }
    canvas.text({x + 29, at.y}, entry.text, {kTickSize});
    const auto glyphs = std::count_if(entry.text.begin(), entry.text.end(),
                                      [](char c) { return (c & 0xC0) != 0x80; });
    x += 29 + 0.56 * kTickSize * static_cast<double>(glyphs) + 16;
  }
}

}  // namespace plumbline::app
