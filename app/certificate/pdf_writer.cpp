#include "app/certificate/pdf_writer.h"

#include <cairo-pdf.h>
#include <fmt/format.h>

#include <memory>

#include "app/certificate/page_flow.h"
#include "app/figure/cairo_canvas.h"

namespace plumbline::app {
namespace {

struct SurfaceDestroy {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
struct CairoDestroy {
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
};

cairo_status_t append(void* closure, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

void draw_foot(cairo_t* cairo, const Typeface& typeface, const Document& document,
               std::size_t number, std::size_t count) {
  constexpr double kSize = 8, kPageWidth = 90;
  const double top = paper::kHeight - paper::kBottom + 12;
  set_color(cairo, "#888888");
  cairo_set_line_width(cairo, 0.5);
  cairo_set_dash(cairo, nullptr, 0, 0);
  cairo_move_to(cairo, paper::kLeft, top - 3);
  cairo_line_to(cairo, paper::kWidth - paper::kRight, top - 3);
  cairo_stroke(cairo);
  set_color(cairo, "#444444");
  const auto show = [&](const std::string& text, double x, const TextSetting& setting) {
    const LayoutPtr layout = typeface.layout(text, setting);
    cairo_move_to(cairo, x, top);
    pango_cairo_show_layout(cairo, layout.get());
  };
  show(document.id, paper::kLeft, {.size = kSize, .width = paper::kTextWidth - kPageWidth - 10});
  show(fmt::format(fmt::runtime(document.words.page_of), number, count),
       paper::kWidth - paper::kRight - kPageWidth,
       {.size = kSize, .width = kPageWidth, .anchor = Anchor::end});
}

}  // namespace

Result<std::string> write_pdf(const Document& document, const Typeface& typeface,
                              const PdfSettings& settings) {
  const FlowedDocument flowed = flow(document, typeface);
  std::string bytes;
  const std::unique_ptr<cairo_surface_t, SurfaceDestroy> surface(
      cairo_pdf_surface_create_for_stream(append, &bytes, paper::kWidth, paper::kHeight));
  cairo_pdf_surface_restrict_to_version(surface.get(), CAIRO_PDF_VERSION_1_5);
  const auto say = [&](cairo_pdf_metadata_t what, const std::string& text) {
    cairo_pdf_surface_set_metadata(surface.get(), what, text.c_str());
  };
  say(CAIRO_PDF_METADATA_TITLE, document.title + " " + document.id);
  say(CAIRO_PDF_METADATA_SUBJECT, document.subtitle);
  say(CAIRO_PDF_METADATA_CREATOR, settings.producer);
  // Without a date Cairo would write the time of this moment.
  say(CAIRO_PDF_METADATA_CREATE_DATE, settings.created_utc);
  say(CAIRO_PDF_METADATA_MOD_DATE, settings.created_utc);

  const std::unique_ptr<cairo_t, CairoDestroy> cairo(cairo_create(surface.get()));
  for (const OutlineEntry& entry : flowed.outline) {
    const std::string place =
        fmt::format("page={} pos=[{:.2f} {:.2f}]", entry.page + 1, paper::kLeft, entry.top);
    cairo_pdf_surface_add_outline(surface.get(), CAIRO_PDF_OUTLINE_ROOT, entry.text.c_str(),
                                  place.c_str(), CAIRO_PDF_OUTLINE_FLAG_OPEN);
  }
  for (std::size_t i = 0; i < flowed.pages.size(); ++i) {
    for (const Drawing& drawing : flowed.pages[i].drawings) {
      cairo_save(cairo.get());
      drawing(cairo.get());
      cairo_restore(cairo.get());
    }
    draw_foot(cairo.get(), typeface, document, i + 1, flowed.pages.size());
    cairo_show_page(cairo.get());
  }
  cairo_surface_finish(surface.get());
  for (const cairo_status_t status :
       {cairo_status(cairo.get()), cairo_surface_status(surface.get())}) {
    if (status == CAIRO_STATUS_SUCCESS) continue;
    return fail(ErrorCode::internal,
                fmt::format("certificate.pdf: {}", cairo_status_to_string(status)));
  }
  return bytes;
}

}  // namespace plumbline::app
