// What `run` and `dry-run` share: measure, then calibrate what was measured.
#pragma once

#include <filesystem>
#include <string>

#include "app/calibration_job.h"
#include "app/exit_code.h"
#include "app/sequencer/job_queue.h"
#include "app/sequencer/notifier.h"
#include "app/sequencer/session.h"

namespace plumbline::app {

struct MeasureRequest {
  SessionRequest session;
  std::filesystem::path out;
  std::uint64_t seed = 1;  ///< of the calibration
  CertificateStyle style = {};
  NotifyOptions notify = {};
  bool separate = false;               ///< measure at once what tells effects apart
  std::filesystem::path effects = {};  ///< of the user; empty: none
  std::string resume_hint;             ///< the command that goes on with a run that has ended early
};

/// Runs the plan alone and says which run it became. `live` and `notifier` are told about it.
Result<storage::RunId> measure(const MeasureRequest& request, LiveState& live, Notifier& notifier);
/// Listens to the sensor until the condition is met; fails (rig) when it is not within its limit,
/// when the sensor is silent or gone for `patience_s`, and when a signal asks to stop.
Result<void> await_condition(const rig::SensorConfig& sensor, const WaitCondition& condition,
                             double patience_s);
/// True once a signal or the control socket has asked to stop.
bool stop_was_requested();
/// What stays the same during the session, for LiveState.
LiveRun live_run(const MeasureRequest& request);

/// Runs the plan with a progress display, orders by signals and by the control socket, then
/// calibrates from the database into `out` and prints the summary.
Result<ExitCode> measure_and_calibrate(const MeasureRequest& request);

}  // namespace plumbline::app
