// Pages filled from top to bottom: where every line, table row and figure of a document goes.
#pragma once

#include <cairo.h>

#include <functional>
#include <string>
#include <vector>

#include "app/certificate/document.h"
#include "app/figure/typeface.h"

namespace plumbline::app {

/// A4 upright, points.
namespace paper {
inline constexpr double kWidth = 595.276;
inline constexpr double kHeight = 841.89;
inline constexpr double kLeft = 45;
inline constexpr double kRight = 45;
inline constexpr double kTop = 45;
inline constexpr double kBottom = 58;  ///< the foot of the page stands inside
inline constexpr double kTextWidth = kWidth - kLeft - kRight;
}  // namespace paper

/// What is drawn on a page, in reading order, in points from the top left corner.
using Drawing = std::function<void(cairo_t*)>;
struct Page {
  std::vector<Drawing> drawings;
};

struct OutlineEntry {
  std::string text;
  std::size_t page = 0;  ///< from 0
  double top = 0;
};

struct FlowedDocument {
  std::vector<Page> pages;
  std::vector<OutlineEntry> outline;  ///< one per heading
};

/// Nothing sticks out of the margins: lines wrap, words too long for their place are broken, tables
/// go on over the page with their heading repeated. The drawings refer to `document` and
/// `typeface`.
FlowedDocument flow(const Document& document, const Typeface& typeface);

}  // namespace plumbline::app
