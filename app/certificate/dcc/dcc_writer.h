// certificate.xml: the digital calibration certificate (DCC 3.3.0, D-SI 2.2.1 of PTB).
#pragma once

#include <string>
#include <string_view>

#include "app/certificate/certificate.h"

namespace plumbline::app {

/// What the other documents of the same certificate are, so that the XML can vouch for them.
struct Siblings {
  std::string html_sha256;
  std::string pdf_pages_sha256;  ///< pdf_file.h: pages without attachments
};

/// refTypes: of the identifications that carry hashes ("sha256:…"), then of results.
namespace dcc_ref {
inline constexpr const char* kSelf = "plumbline_documentSha256";
inline constexpr const char* kWords = "plumbline_wordsSha256";
inline constexpr const char* kResult = "plumbline_resultSha256";
inline constexpr const char* kHtml = "plumbline_htmlSha256";
inline constexpr const char* kPdf = "plumbline_pdfPagesSha256";
inline constexpr const char* kChain = "plumbline_chainHeadSha256";
inline constexpr const char* kSigner = "plumbline_signerSha256";
inline constexpr const char* kNumber = "plumbline_laboratoryNumber";
inline constexpr const char* kOrder = "plumbline_customerOrder";
inline constexpr const char* kInput = "plumbline_inputSha256";
inline constexpr const char* kSensitivity = "plumbline_sensitivity";
inline constexpr const char* kOffset = "plumbline_offset";
inline constexpr const char* kBias = "plumbline_bias";
inline constexpr const char* kScale = "plumbline_scale";
inline constexpr const char* kNonorthogonality = "plumbline_nonorthogonality";
inline constexpr const char* kIeee1293 = "plumbline_ieee1293";
inline constexpr const char* kEffect = "plumbline_effect";
inline constexpr const char* kDetectionLimit = "plumbline_detectionLimit";
inline constexpr const char* kError = "plumbline_error";
inline constexpr const char* kConformity = "plumbline_conformity";
inline constexpr const char* kNoise = "plumbline_noise";
}  // namespace dcc_ref

/// What the XSD demands and was not stated carries these: a country code for private use, and
/// words.
inline constexpr const char* kUnknownCountry = "ZZ";

/// UTF-8. The numbers are those of result.json, digit by digit, beside their values in SI units.
/// `document` is the certificate in words; same input, same bytes.
std::string write_dcc(const CertificateInput& input, const Document& document,
                      const Siblings& siblings);

/// SHA-256 of a certificate.xml without its signature and with its own hash replaced by zeros; what
/// the file states as kSelf. Empty when the file states none.
std::string dcc_self_hash(std::string_view xml);

}  // namespace plumbline::app
