// A finished PDF: attachments in and out, and a hash over what its pages show.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

struct Attachment {
  std::string name;  ///< "certificate.xml"
  std::string mime;  ///< "text/xml"
  std::string description;
  std::string content;
};

/// The PDF with the files attached as its source data (ISO 32000-2, associated files), dated
/// `created_utc`. Same input, same bytes. Fails (internal) when the PDF cannot be read.
Result<std::string> attach(std::string_view pdf, const std::vector<Attachment>& attachments,
                           const std::string& created_utc);

struct OpenedPdf {
  std::string pages_sha256;  ///< over all that the pages refer to, decoded; attachments are not
  std::vector<Attachment> attachments;  ///< name and content
};

/// Fails (input) with `name` when the bytes are no PDF or a damaged one.
Result<OpenedPdf> open_pdf(std::string_view pdf, const std::string& name);

}  // namespace plumbline::app
