// Axes of a diagram: scales, ticks, frame, and data drawn in data coordinates.
#pragma once

#include <string>
#include <vector>

#include "app/figure/canvas.h"

namespace plumbline::app {

enum class ScaleKind { linear, logarithmic };

/// One axis of a plot in data units.
struct PlotAxis {
  std::string label;  ///< quantity and unit; empty: no label
  double min = 0;
  double max = 1;
  ScaleKind kind = ScaleKind::linear;
  bool tick_labels = true;
  int ticks = 5;  ///< about so many on a linear axis
};

/// "Nice" tick positions within [min, max]: 1, 2 or 5 times a power of ten, or decades.
std::vector<double> tick_positions(const PlotAxis& axis);
/// Tick labels without needless digits; common to all ticks of one axis.
std::vector<std::string> tick_texts(const PlotAxis& axis, const std::vector<double>& ticks);

/// A rectangle of a canvas with two axes. The area excludes labels, which are drawn around it.
class Plot {
 public:
  Plot(Canvas& canvas, Point top_left, double width, double height, PlotAxis x, PlotAxis y);

  /// Draws grid lines, ticks, labels, frame and title above.
  void draw_frame(const std::string& title = {});

  Point at(double x, double y) const;
  void line(const std::vector<double>& x, const std::vector<double>& y, const Stroke& stroke);
  /// Between two curves.
  void band(const std::vector<double>& x, const std::vector<double>& lower,
            const std::vector<double>& upper, const std::string& fill, double opacity);
  void points(const std::vector<double>& x, const std::vector<double>& y, double radius,
              const std::string& fill);
  void bar(double x_from, double x_to, double y, const std::string& fill);

 private:
  double x_of(double value) const;
  double y_of(double value) const;

  Canvas& canvas_;
  Point top_left_;
  double width_, height_;
  PlotAxis x_, y_;
};

/// One entry of a legend.
struct LegendEntry {
  std::string text;
  Stroke stroke;         ///< drawn as a short line …
  std::string fill;      ///< … or, when not empty, as a filled box
  double opacity = 0.6;  ///< of the box, as that of what it stands for
};
/// Entries in a row from `at` to the right.
void draw_legend(Canvas& canvas, Point at, const std::vector<LegendEntry>& entries);

}  // namespace plumbline::app
