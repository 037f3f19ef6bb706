// The fonts of printed documents: two families by name and nothing else that the machine may have,
// so that the same text gives the same bytes everywhere.
#pragma once

#include <pango/pangocairo.h>

#include <memory>
#include <string>
#include <string_view>

#include "app/figure/canvas.h"
#include "estimator/measurement.h"

namespace plumbline::app {

struct GObjectUnref {
  void operator()(void* object) const { g_object_unref(object); }
};
using LayoutPtr = std::unique_ptr<PangoLayout, GObjectUnref>;

/// How a piece of text is set; sizes and widths in points.
struct TextSetting {
  double size = 9.5;
  bool bold = false;
  bool italic = false;
  double width = -1;  ///< wraps there, inside a word if need be; below 0: one line
  Anchor anchor = Anchor::start;
};

/// Liberation Sans (Latin, Greek, Cyrillic), DejaVu Sans for what it lacks. Unhinted, so that
/// lengths do not depend on a resolution. Move-only.
class Typeface {
 public:
  /// Fails (output) with the missing file: the fonts come with the Debian packages
  /// fonts-liberation2 and fonts-dejavu-core; `folder` may hold the files instead of the places of
  /// these packages.
  static Result<Typeface> load(const std::string& folder = {});

  /// Never null; the language is that of line breaking and shaping ("en", "uk").
  LayoutPtr layout(std::string_view text, const TextSetting& setting) const;
  /// Width of the text in one line, points.
  double width(std::string_view text, const TextSetting& setting) const;

 private:
  struct FontMapUnref {
    void operator()(PangoFontMap* map) const { g_object_unref(map); }
  };
  struct ContextUnref {
    void operator()(PangoContext* context) const { g_object_unref(context); }
  };
  Typeface() = default;
  std::unique_ptr<PangoFontMap, FontMapUnref> map_;
  std::unique_ptr<PangoContext, ContextUnref> context_;
};

}  // namespace plumbline::app
