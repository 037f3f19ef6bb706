// Canvas that draws with Cairo: into a PDF page, or onto any other surface.
#pragma once

#include <cairo.h>

#include "app/figure/canvas.h"
#include "app/figure/typeface.h"

namespace plumbline::app {

/// Draws in the current coordinates of `cairo`, which the caller scales so that a unit is a CSS
/// pixel; leaves its state as it was. Neither `cairo` nor `typeface` is owned.
class CairoCanvas final : public Canvas {
 public:
  CairoCanvas(cairo_t* cairo, const Typeface& typeface) : cairo_(cairo), typeface_(typeface) {}

  void polyline(const std::vector<Point>& points, const Stroke& stroke) override;
  void polygon(const std::vector<Point>& points, const std::string& fill, double opacity) override;
  void circle(Point centre, double radius, const std::string& fill, const Stroke& stroke) override;
  void text(Point at, std::string_view text, const TextStyle& style) override;
  void push_clip(Point top_left, double width, double height) override;
  void pop_clip() override;

 private:
  void set_stroke(const Stroke& stroke);
  void trace(const std::vector<Point>& points);

  cairo_t* cairo_;
  const Typeface& typeface_;
};

/// Sets the colour "#rrggbb".
void set_color(cairo_t* cairo, const std::string& color, double opacity = 1);

}  // namespace plumbline::app
