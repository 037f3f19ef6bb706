#include "app/figure/cairo_canvas.h"

#include <cassert>
#include <charconv>
#include <numbers>

namespace plumbline::app {

void set_color(cairo_t* cairo, const std::string& color, double opacity) {
  assert(color.size() == 7 && color.front() == '#');
  const auto part = [&](std::size_t at) {
    int value = 0;
    std::from_chars(color.data() + at, color.data() + at + 2, value, 16);
    return value / 255.0;
  };
  cairo_set_source_rgba(cairo, part(1), part(3), part(5), opacity);
}

void CairoCanvas::set_stroke(const Stroke& stroke) {
  set_color(cairo_, stroke.color);
  cairo_set_line_width(cairo_, stroke.width);
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  cairo_set_dash(cairo_, stroke.dash.data(), static_cast<int>(stroke.dash.size()), 0);
}

void CairoCanvas::trace(const std::vector<Point>& points) {
  cairo_new_path(cairo_);
  for (const Point& point : points) cairo_line_to(cairo_, point.x, point.y);
}

void CairoCanvas::polyline(const std::vector<Point>& points, const Stroke& stroke) {
  if (stroke.color.empty()) return;
  trace(points);
  set_stroke(stroke);
  cairo_stroke(cairo_);
}

void CairoCanvas::polygon(const std::vector<Point>& points, const std::string& fill,
                          double opacity) {
  if (fill.empty()) return;
  trace(points);
  cairo_close_path(cairo_);
  set_color(cairo_, fill, opacity);
  cairo_fill(cairo_);
}

void CairoCanvas::circle(Point centre, double radius, const std::string& fill,
                         const Stroke& stroke) {
  cairo_new_path(cairo_);
  if (stroke.color.empty()) {
    // A line without length and with round ends: of thousands of dots a circle each is most of a
    // page.
    if (fill.empty()) return;
    cairo_move_to(cairo_, centre.x, centre.y);
    cairo_close_path(cairo_);
    cairo_save(cairo_);
    set_stroke({.color = fill, .width = 2 * radius, .dash = {}});
    cairo_set_line_cap(cairo_, CAIRO_LINE_CAP_ROUND);
    cairo_stroke(cairo_);
    cairo_restore(cairo_);
    return;
  }
  cairo_arc(cairo_, centre.x, centre.y, radius, 0, 2 * std::numbers::pi);
  if (!fill.empty()) {
    set_color(cairo_, fill);
    cairo_fill_preserve(cairo_);
  }
  set_stroke(stroke);
  cairo_stroke(cairo_);
}

void CairoCanvas::text(Point at, std::string_view text, const TextStyle& style) {
  const LayoutPtr layout = typeface_.layout(text, {.size = style.size, .bold = style.bold});
  PangoRectangle logical;
  pango_layout_get_extents(layout.get(), nullptr, &logical);
  const double width = static_cast<double>(logical.width) / PANGO_SCALE;
  const double baseline =
      static_cast<double>(pango_layout_get_baseline(layout.get())) / PANGO_SCALE;
  const double shift = style.anchor == Anchor::start    ? 0
                       : style.anchor == Anchor::middle ? -width / 2
                                                        : -width;
  cairo_save(cairo_);
  cairo_translate(cairo_, at.x, at.y);
  if (style.rotate_deg != 0) cairo_rotate(cairo_, style.rotate_deg * std::numbers::pi / 180);
  cairo_move_to(cairo_, shift, -baseline);
  set_color(cairo_, style.color);
  pango_cairo_show_layout(cairo_, layout.get());
  cairo_restore(cairo_);
}

void CairoCanvas::push_clip(Point top_left, double width, double height) {
  cairo_save(cairo_);
  cairo_rectangle(cairo_, top_left.x, top_left.y, width, height);
  cairo_clip(cairo_);
}

void CairoCanvas::pop_clip() { cairo_restore(cairo_); }

}  // namespace plumbline::app
