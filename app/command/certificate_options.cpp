#include "app/command/certificate_options.h"

#include <cstdlib>

#include "app/certificate/certificate_files.h"

namespace plumbline::app {

void add_certificate_options(CLI::App& command, CertificateOptions& options) {
  command.add_option("--lab", options.laboratory,
                     "lab.toml: laboratory, customer, traceability, procedure, who authorises and "
                     "the key that signs, for the certificate; what it lacks is printed as not "
                     "stated");
  command.add_option("--language", options.language, "of the certificate: en or uk")
      ->check(CLI::IsMember({"en", "uk"}))
      ->capture_default_str();
}

Result<CertificateStyle> certificate_style(const CertificateOptions& options) {
  // Fonts that are missing are known before anything is measured, not after it.
  if (auto can = certificate_can_be_written(); !can) return fail(can.error());
  CertificateStyle style;
  style.language = options.language == "uk" ? Language::uk : Language::en;
  if (options.laboratory.empty()) return style;
  auto laboratory = read_laboratory(options.laboratory);
  if (!laboratory) return fail(laboratory.error());
  style.laboratory = *std::move(laboratory);
  if (style.laboratory.signing_key.empty()) return style;
  const char* passphrase = std::getenv("PLUMBLINE_KEY_PASSPHRASE");
  auto key = read_signing_key(style.laboratory.signing_key, style.laboratory.signing_certificate,
                              passphrase == nullptr ? "" : passphrase);
  if (!key) return fail(key.error());
  style.signing = *std::move(key);
  return style;
}

}  // namespace plumbline::app
