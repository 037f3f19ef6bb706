// What `calibrate`, `run` and `dry-run` share: how their certificate is to look.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "app/calibration_job.h"

namespace plumbline::app {

struct CertificateOptions {
  std::string laboratory;  ///< lab.toml; empty: none
  std::string language = "en";
};

/// Declares --lab and --language.
void add_certificate_options(CLI::App& command, CertificateOptions& options);

/// Reads lab.toml and makes sure that the certificate can be written; do it before anything that
/// takes long.
Result<CertificateStyle> certificate_style(const CertificateOptions& options);

}  // namespace plumbline::app
