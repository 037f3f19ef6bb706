// The files of a certificate in an output folder.
#pragma once

#include <string>

#include "app/certificate/certificate.h"
#include "app/io/output_folder.h"

namespace plumbline::app {

/// certificate.html, certificate.xml and certificate.pdf: three forms of one document. The XML
/// vouches for the other two and is attached to the PDF. Fails (output) when the fonts are missing
/// or the folder cannot be written.
Result<void> write_certificate(const CertificateInput& input, OutputFolder& folder);

/// Success when the fonts of the PDF are there; for asking before a long measurement.
Result<void> certificate_can_be_written();

}  // namespace plumbline::app
