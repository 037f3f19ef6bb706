// Is a certificate what it was when it was written, and do its forms say the same?
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "app/verify/report.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// `target`: an output folder (certificate.xml, .html, .pdf and result.json), or one
/// certificate.xml or certificate.pdf. Checks, as far as the files are there: the schema when one
/// is given, the rules beyond it, the XML's own hash, the hashes of result.json, HTML and PDF pages
/// that the XML states, the words of the HTML, that the XML attached to the PDF is the one beside
/// it, that the numbers of result.json, XML and HTML are the same, and the XML's signature. With
/// `signer` (certificates in PEM) it must be signed by one of them or by whom one of them vouches
/// for.
/// Fails (input) when the target or a file that must be there cannot be read.
Result<VerifyReport> verify_certificate(const std::filesystem::path& target,
                                        const std::optional<std::filesystem::path>& schema,
                                        const std::optional<std::filesystem::path>& signer = {});

/// Words of a certificate.html outside style, pictures and footer: those of words_of(document).
/// Fails (input) when it is not well-formed.
Result<std::vector<std::string>> html_words(std::string_view html, const std::string& name);

}  // namespace plumbline::app
