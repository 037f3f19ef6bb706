#include "app/certificate/certificate_files.h"

#include <future>

#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/dcc/signature.h"
#include "app/certificate/pdf_file.h"
#include "app/certificate/pdf_writer.h"
#include "app/io/sha256.h"

namespace plumbline::app {
namespace {

Result<std::string> pages_of(const Document& document, const std::string& created_utc) {
  const auto typeface = Typeface::load();
  if (!typeface) return fail(typeface.error());
  return write_pdf(document, *typeface,
                   {.created_utc = created_utc, .producer = "plumbline " + program_version()});
}

}  // namespace

Result<void> write_certificate(const CertificateInput& input, OutputFolder& folder) {
  const std::string& created_utc = input.provenance.created_utc;
  const Document document = make_certificate(input);
  auto printing = std::async(std::launch::async, [&] { return pages_of(document, created_utc); });
  const std::string html = write_html(document);
  const auto pages = printing.get();
  if (!pages) return fail(pages.error());
  const auto opened = open_pdf(*pages, "certificate.pdf");
  if (!opened) return fail(ErrorCode::internal, opened.error().message);
  std::string plain_xml = write_dcc(
      input, document, {.html_sha256 = sha256(html), .pdf_pages_sha256 = opened->pages_sha256});
  const auto signed_xml = input.signing == nullptr ? Result<std::string>(std::move(plain_xml))
                                                   : sign_dcc(plain_xml, *input.signing);
  if (!signed_xml) return fail(signed_xml.error());
  const std::string& xml = *signed_xml;
  const auto pdf = attach(*pages,
                          {{.name = "certificate.xml",
                            .mime = "text/xml",
                            .description = "Digital calibration certificate (DCC)",
                            .content = xml}},
                          created_utc);
  if (!pdf) return fail(pdf.error());
  for (const auto& [name, content] :
       {std::pair("certificate.html", &html), std::pair("certificate.xml", &xml),
        std::pair("certificate.pdf", &*pdf)}) {
    if (auto done = folder.write(name, *content); !done) return done;
  }
  return {};
}

Result<void> certificate_can_be_written() {
  if (auto typeface = Typeface::load(); !typeface) return fail(typeface.error());
  return {};
}

}  // namespace plumbline::app
