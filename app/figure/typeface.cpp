#include "app/figure/typeface.h"

#include <fmt/format.h>
#include <fontconfig/fontconfig.h>
#include <pango/pangofc-fontmap.h>

#include <array>
#include <filesystem>

namespace plumbline::app {
namespace {

struct FontFile {
  const char* folder;
  const char* name;
  const char* package;
};

constexpr std::array kFontFiles = {
    FontFile{"/usr/share/fonts/truetype/liberation2", "LiberationSans-Regular.ttf",
             "fonts-liberation2"},
    FontFile{"/usr/share/fonts/truetype/liberation2", "LiberationSans-Bold.ttf",
             "fonts-liberation2"},
    FontFile{"/usr/share/fonts/truetype/liberation2", "LiberationSans-Italic.ttf",
             "fonts-liberation2"},
    FontFile{"/usr/share/fonts/truetype/dejavu", "DejaVuSans.ttf", "fonts-dejavu-core"},
    FontFile{"/usr/share/fonts/truetype/dejavu", "DejaVuSans-Bold.ttf", "fonts-dejavu-core"},
};

struct ConfigDestroy {
  void operator()(FcConfig* config) const { FcConfigDestroy(config); }
};

struct OptionsDestroy {
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
};

}  // namespace

Result<Typeface> Typeface::load(const std::string& folder) {
  // An empty configuration: no font, no rule of this machine.
  const std::unique_ptr<FcConfig, ConfigDestroy> config(FcConfigCreate());
  for (const FontFile& font : kFontFiles) {
    const std::filesystem::path path =
        std::filesystem::path(folder.empty() ? font.folder : folder) / font.name;
    const auto* name = reinterpret_cast<const FcChar8*>(path.c_str());
    if (FcConfigAppFontAddFile(config.get(), name) == FcFalse) {
      return fail(ErrorCode::output,
                  fmt::format("{}: cannot be read; certificate.pdf needs the fonts of {}",
                              path.string(), font.package));
    }
  }
  Typeface typeface;
  typeface.map_.reset(pango_cairo_font_map_new_for_font_type(CAIRO_FONT_TYPE_FT));
  pango_fc_font_map_set_config(PANGO_FC_FONT_MAP(typeface.map_.get()), config.get());
  // One unit is a point.
  pango_cairo_font_map_set_resolution(PANGO_CAIRO_FONT_MAP(typeface.map_.get()), 72);
  typeface.context_.reset(pango_font_map_create_context(typeface.map_.get()));
  const std::unique_ptr<cairo_font_options_t, OptionsDestroy> options(cairo_font_options_create());
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_antialias(options.get(), CAIRO_ANTIALIAS_GRAY);
  pango_cairo_context_set_font_options(typeface.context_.get(), options.get());
  pango_context_set_round_glyph_positions(typeface.context_.get(), FALSE);
  // Not the language of whoever runs the program.
  pango_context_set_language(typeface.context_.get(), pango_language_from_string("en"));
  return typeface;
}

LayoutPtr Typeface::layout(std::string_view text, const TextSetting& setting) const {
  LayoutPtr layout(pango_layout_new(context_.get()));
  PangoFontDescription* font = pango_font_description_new();
  pango_font_description_set_family_static(font, "Liberation Sans, DejaVu Sans");
  pango_font_description_set_absolute_size(font, setting.size * PANGO_SCALE);
  if (setting.bold) pango_font_description_set_weight(font, PANGO_WEIGHT_BOLD);
  if (setting.italic) pango_font_description_set_style(font, PANGO_STYLE_ITALIC);
  pango_layout_set_font_description(layout.get(), font);
  pango_font_description_free(font);
  // A long word is broken where the line ends; a hyphen would be a letter that is not there.
  PangoAttrList* attributes = pango_attr_list_new();
  pango_attr_list_insert(attributes, pango_attr_insert_hyphens_new(FALSE));
  pango_layout_set_attributes(layout.get(), attributes);
  pango_attr_list_unref(attributes);
  pango_layout_set_wrap(layout.get(), PANGO_WRAP_WORD_CHAR);
  pango_layout_set_width(layout.get(),
                         setting.width < 0 ? -1 : static_cast<int>(setting.width * PANGO_SCALE));
  pango_layout_set_alignment(layout.get(), setting.anchor == Anchor::start    ? PANGO_ALIGN_LEFT
                                           : setting.anchor == Anchor::middle ? PANGO_ALIGN_CENTER
                                                                              : PANGO_ALIGN_RIGHT);
  pango_layout_set_text(layout.get(), text.data(), static_cast<int>(text.size()));
  return layout;
}

double Typeface::width(std::string_view text, const TextSetting& setting) const {
  TextSetting one_line = setting;
  one_line.width = -1;
  const LayoutPtr set = layout(text, one_line);
  PangoRectangle logical;
  pango_layout_get_extents(set.get(), nullptr, &logical);
  return static_cast<double>(logical.width) / PANGO_SCALE;
}

}  // namespace plumbline::app
