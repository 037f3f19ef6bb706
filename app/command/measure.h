// What `run` and `dry-run` share: measure, then calibrate what was measured.
#pragma once

#include <filesystem>
#include <string>

#include "app/calibration_job.h"
#include "app/exit_code.h"
#include "app/sequencer/session.h"

namespace plumbline::app {

struct MeasureRequest {
  SessionRequest session;
  std::filesystem::path out;
  std::uint64_t seed = 1;  ///< of the calibration
  CertificateStyle style;
  std::string resume_hint;  ///< the command that goes on with a run that has ended early
};

/// Runs the plan with a progress display, SIGINT and SIGTERM stopping it safely, then calibrates
/// from the database into `out` and prints the summary.
Result<ExitCode> measure_and_calibrate(const MeasureRequest& request);

}  // namespace plumbline::app
