// certificate.pdf.
#pragma once

#include <string>

#include "app/certificate/document.h"
#include "app/figure/typeface.h"

namespace plumbline::app {

struct PdfSettings {
  std::string created_utc;  ///< "2026-01-31T12:34:56Z": the date inside the file
  std::string producer;     ///< program and version
};

/// A4 pages with selectable text, embedded fonts, bookmarks, and on every page the number of the
/// certificate and "page n of m". Same document, same settings: same bytes. Fails (internal) when
/// Cairo does.
Result<std::string> write_pdf(const Document& document, const Typeface& typeface,
                              const PdfSettings& settings);

}  // namespace plumbline::app
