#include "app/figure/svg_canvas.h"

#include <fmt/format.h>

#include <cmath>

namespace plumbline::app {
namespace {

// Two decimals are below what any printer resolves; fewer bytes, and no "-0".
std::string number(double value) {
  std::string text = fmt::format("{:.2f}", value);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

std::string path_points(const std::vector<Point>& points) {
  std::string text;
  for (const Point& point : points) {
    if (!text.empty()) text += ' ';
    text += number(point.x) + ',' + number(point.y);
  }
  return text;
}

std::string stroke_attributes(const Stroke& stroke) {
  if (stroke.color.empty()) return R"( stroke="none")";
  std::string text =
      fmt::format(R"( stroke="{}" stroke-width="{}")", stroke.color, number(stroke.width));
  if (!stroke.dash.empty()) {
    std::string lengths;
    for (double length : stroke.dash) lengths += (lengths.empty() ? "" : " ") + number(length);
    text += fmt::format(R"( stroke-dasharray="{}")", lengths);
  }
  return text;
}

// Stands for the caller's prefix until svg() knows it.
constexpr std::string_view kPrefixMark = "\x01";

}  // namespace

std::string escape_xml(std::string_view text) {
  std::string escaped;
  escaped.reserve(text.size());
  for (char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

SvgCanvas::SvgCanvas(double width, double height) : width_(width), height_(height) {}

void SvgCanvas::polyline(const std::vector<Point>& points, const Stroke& stroke) {
  body_ += fmt::format("<polyline points=\"{}\" fill=\"none\"{} stroke-linejoin=\"round\"/>\n",
                       path_points(points), stroke_attributes(stroke));
}

void SvgCanvas::polygon(const std::vector<Point>& points, const std::string& fill, double opacity) {
  body_ += fmt::format("<polygon points=\"{}\" fill=\"{}\"", path_points(points), fill);
  if (opacity < 1) body_ += fmt::format(" fill-opacity=\"{}\"", number(opacity));
  body_ += "/>\n";
}

void SvgCanvas::circle(Point centre, double radius, const std::string& fill, const Stroke& stroke) {
  body_ += fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"{}/>\n", number(centre.x),
                       number(centre.y), number(radius), fill.empty() ? "none" : fill,
                       stroke_attributes(stroke));
}

void SvgCanvas::text(Point at, std::string_view text, const TextStyle& style) {
  constexpr const char* kAnchorName[] = {"start", "middle", "end"};
  body_ += fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"{}\" fill=\"{}\" text-anchor=\"{}\"",
                       number(at.x), number(at.y), number(style.size), style.color,
                       kAnchorName[static_cast<int>(style.anchor)]);
  if (style.bold) body_ += " font-weight=\"bold\"";
  if (style.rotate_deg != 0) {
    body_ += fmt::format(" transform=\"rotate({} {} {})\"", number(style.rotate_deg), number(at.x),
                         number(at.y));
  }
  body_ += fmt::format(">{}</text>\n", escape_xml(text));
}

void SvgCanvas::push_clip(Point top_left, double width, double height) {
  ++clips_;
  body_ += fmt::format(
      "<clipPath id=\"{0}c{1}\"><rect x=\"{2}\" y=\"{3}\" width=\"{4}\" "
      "height=\"{5}\"/></clipPath>\n<g clip-path=\"url(#{0}c{1})\">\n",
      kPrefixMark, clips_, number(top_left.x), number(top_left.y), number(width), number(height));
}

void SvgCanvas::pop_clip() { body_ += "</g>\n"; }

std::string SvgCanvas::svg(std::string_view id_prefix, std::string_view description) const {
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "height=\"{1}\" role=\"img\" font-family=\"Helvetica, Arial, 'Liberation Sans', "
      "sans-serif\">\n<title>{2}</title>\n",
      number(width_), number(height_), escape_xml(description));
  for (char c : body_) {
    if (c == kPrefixMark.front()) {
      text += id_prefix;
    } else {
      text += c;
    }
  }
  return text + "</svg>\n";
}

}  // namespace plumbline::app
