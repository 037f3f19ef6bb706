// Canvas that writes SVG 1.1.
#pragma once

#include <string>

#include "app/figure/canvas.h"

namespace plumbline::app {

/// Same calls, same bytes.
class SvgCanvas final : public Canvas {
 public:
  SvgCanvas(double width, double height);

  void polyline(const std::vector<Point>& points, const Stroke& stroke) override;
  void polygon(const std::vector<Point>& points, const std::string& fill, double opacity) override;
  void circle(Point centre, double radius, const std::string& fill, const Stroke& stroke) override;
  void text(Point at, std::string_view text, const TextStyle& style) override;
  void push_clip(Point top_left, double width, double height) override;
  void pop_clip() override;

  /// The complete <svg> element. `id_prefix` keeps ids apart when several stand in one document;
  /// `description` is what a screen reader says instead of the picture.
  std::string svg(std::string_view id_prefix, std::string_view description) const;

 private:
  double width_, height_;
  std::string body_;
  int clips_ = 0;
};

/// Escapes the five special characters of XML.
std::string escape_xml(std::string_view text);

}  // namespace plumbline::app
