// XML signature (W3C XML Signature 1.1) of a digital certificate with a key of the laboratory.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

/// A private key and the X.509 certificate that says whose it is.
struct SigningKey {
  std::string key_pem;
  std::string passphrase;
  std::string certificate_pem;
  std::string subject;             ///< of the certificate, RFC 2253: "CN=Lab 7,O=Example"
  std::string certificate_sha256;  ///< of its DER form
};

/// RSA (at least 2048 bits) or ECDSA, in PEM. Refused (input): files that cannot be read, a wrong
/// passphrase, a certificate that belongs to another key or has expired.
Result<SigningKey> read_signing_key(const std::filesystem::path& key,
                                    const std::filesystem::path& certificate,
                                    const std::string& passphrase);

/// The certificate with an enveloped signature (SHA-256, exclusive canonicalisation) as the root's
/// last child; nothing else of the text is touched. RSA: same input, same bytes.
Result<std::string> sign_dcc(std::string_view xml, const SigningKey& key);

/// The text as it was before it was signed.
std::string without_signature(std::string_view xml);

struct SignatureFound {
  bool present = false;
  std::string wrong;  ///< why it does not hold for the whole document; empty: it holds
  std::string subject;
  std::string certificate_sha256;
  std::string valid;  ///< "2026-01-01 to 2027-01-01"
  /// Whether the signer's certificate is one of those given or was issued by one of them; nothing
  /// when none were given.
  std::optional<bool> trusted;
};

/// Exactly one signature over all of the document, by the key of the certificate in it. Validity of
/// the certificate in time is told, not judged: the signature carries no time of its own.
/// `trusted_pem`: certificates, PEM, one after the other; empty: none. Fails (input) when they
/// cannot be read.
Result<SignatureFound> check_signature(std::string_view xml, const std::string& trusted_pem);

}  // namespace plumbline::app
