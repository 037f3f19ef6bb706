// A calibration without angles from its files to its output folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "app/certificate/scalar_results.h"
#include "app/certificate/style.h"
#include "app/exit_code.h"

namespace plumbline::app {

struct ScalarFiles {
  std::filesystem::path samples;
  std::filesystem::path config;
  std::string columns;         ///< "x=ax_raw,y=ay_raw,z=az_raw"; empty: ux_V, uy_V, uz_V
  bool detect_static = false;  ///< cut a continuous record into rests
  double rate_hz = 0;          ///< of a file without t_s; 0: one reading a second when it has poses
  bool skip_bad_rows = false;
};

struct ScalarOutcome {
  ScalarCalibration calibration;
  ExitCode exit_code = ExitCode::done;
  std::string summary;  ///< for a person; the last line says what came out
};

/// Reads, calibrates and writes result.json and the certificate into `out`: all or, on failure,
/// none.
Result<ScalarOutcome> calibrate_scalar_files(const ScalarFiles& files,
                                             const CertificateStyle& style,
                                             const std::filesystem::path& out, std::uint64_t seed);

/// The detector of rests in words, for help and certificate.
std::string rest_detector_words();

}  // namespace plumbline::app
