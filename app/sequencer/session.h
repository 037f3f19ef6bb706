// One run from a description of the rig to committed poses: opens everything that an engine needs.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/config/rig_description.h"
#include "app/sequencer/engine.h"
#include "estimator/measurement.h"
#include "storage/run_store.h"

namespace plumbline::app {

/// Grid steps, numbered from 0, that a run goes on with once its plan is done, and why.
struct FurtherSteps {
  std::vector<PlanStep> steps;
  std::vector<std::string> reasons = {};  ///< noted with the run, an event each
};

struct SessionRequest {
  const RigDescription& rig;
  std::filesystem::path database;
  /// Where the results will be; only looked at. A finished run is resumed, which measures nothing,
  /// as long as there are none.
  std::filesystem::path out = {};
  bool resume = false;             ///< go on with the last unfinished run of rig.run.dut.serial
  std::string operator_name = {};  ///< who measures; noted as an event unless empty
  std::string job = {};            ///< of a queue, and when it began; noted like the operator
  std::optional<Plan> plan = {};   ///< instead of the one that `rig` describes
  /// Asked once the plan is done.
  std::function<Result<FurtherSteps>(storage::RunId)> further = {};
};

/// A run that has been started: how it ended, and which one it is.
struct Session {
  storage::RunId run = 0;
  Result<void> outcome;  ///< as of Engine::run()
};

/// Whether run_session() with `resume` would find a run to go on with: the unit's last run has this
/// configuration and plan and was begun for this `job`. It may be finished: whoever asks knows that
/// nothing has come of it yet.
Result<bool> resumable(const RigDescription& rig, const std::filesystem::path& database,
                       const std::string& job);

/// Fails before anything moves when the plan, the room on the disk, the database, the run to be
/// resumed or the sensor bus refuses; a failure is then the whole result. What goes wrong with
/// further steps is the session's outcome. A resumed run must have
/// the same configuration and plan, word for word (the addresses of drive and node excepted); its
/// clock goes on by the time that has passed since its last event. One that was interrupted among
/// its further poses, or before them, is asked for them anew: `further` sees those it has.
Result<Session> run_session(const SessionRequest& request, const EngineControl& control,
                            const ProgressObserver& observer);

}  // namespace plumbline::app
