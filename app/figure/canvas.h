// A small drawing surface that every figure is drawn on; writers of other formats implement it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace plumbline::app {

/// A point in figure units: 1/96 inch (CSS px), x to the right, y down, origin at the top left.
struct Point {
  double x = 0;
  double y = 0;
};

/// "#rrggbb", or empty for "not drawn".
struct Stroke {
  std::string color;
  double width = 1;
  std::vector<double> dash;  ///< lengths of dashes and gaps; empty is a full line
};

enum class Anchor { start, middle, end };

struct TextStyle {
  double size = 11;
  Anchor anchor = Anchor::start;
  double rotate_deg = 0;  ///< about the anchor point, clockwise
  bool bold = false;
  std::string color = "#222222";
};

/// Drawing surface. Later calls paint over earlier ones.
class Canvas {
 public:
  virtual ~Canvas() = default;
  virtual void polyline(const std::vector<Point>& points, const Stroke& stroke) = 0;
  /// Closed and filled; `opacity` 0 … 1.
  virtual void polygon(const std::vector<Point>& points, const std::string& fill,
                       double opacity = 1) = 0;
  virtual void circle(Point centre, double radius, const std::string& fill,
                      const Stroke& stroke) = 0;
  virtual void text(Point at, std::string_view text, const TextStyle& style) = 0;
  /// What is drawn until pop_clip() shows only inside the rectangle.
  virtual void push_clip(Point top_left, double width, double height) = 0;
  virtual void pop_clip() = 0;

  void line(Point from, Point to, const Stroke& stroke) { polyline({from, to}, stroke); }
  void rectangle(Point top_left, double width, double height, const std::string& fill,
                 double opacity = 1) {
    const auto [x, y] = top_left;
    polygon({{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}}, fill, opacity);
  }
};

/// Colours that stay apart in print and for people who do not see red and green alike
/// (Okabe & Ito 2008).
namespace palette {
inline constexpr const char* kBlack = "#222222";
inline constexpr const char* kGrey = "#8a8a8a";
inline constexpr const char* kLightGrey = "#d9d9d9";
inline constexpr const char* kBlue = "#0072b2";
inline constexpr const char* kSky = "#56b4e9";
inline constexpr const char* kOrange = "#d55e00";
inline constexpr const char* kYellow = "#e69f00";
inline constexpr const char* kGreen = "#009e73";
}  // namespace palette

}  // namespace plumbline::app
