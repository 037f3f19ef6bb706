// What a certificate says and how, beside what was measured.
#pragma once

#include <optional>

#include "app/certificate/certificate.h"
#include "app/certificate/dcc/signature.h"

namespace plumbline::app {

struct CertificateStyle {
  Laboratory laboratory;
  Language language = Language::en;
  std::optional<SigningKey> signing;
};

}  // namespace plumbline::app
