// What an engine tells about itself while it works: for displays, the control socket, a station.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "estimator/measurement.h"
#include "rig/dividing_head.h"
#include "storage/run_store.h"

namespace plumbline::app {

/// Every change is written into the run's events.
enum class EngineState {
  idle,        ///< nothing moves; waiting for the first sample
  homing,      ///< both axes look for their reference
  moving,      ///< on the way to a pose
  settling,    ///< in position; the output comes to rest
  sampling,    ///< taking the samples of a pose
  paused,      ///< motors stopped, on request or because a condition of [[suspend]] is not met
  recovering,  ///< after a fault, before the pose is measured again
  stopping,    ///< bringing the motors into the safe state
  finished,    ///< the plan is done
  stopped,     ///< ended on request; resumable
  failed,      ///< ended by a fault; resumable
};
const char* to_string(EngineState state);

/// Reason of a pause that somebody asked for.
inline constexpr const char* kPausedOnRequest = "asked to pause";

/// A committed pose in one line.
struct PoseMean {
  long long step = 0;  ///< of the plan, from 0
  storage::PoseKind kind = storage::PoseKind::grid;
  rig::HeadAngles target;
  double t_s = 0;  ///< of the first sample
  double settle_s = 0;
  std::size_t samples = 0;
  PerAxis<double> mean_V{};
  PerAxis<double> sd_V{};  ///< of one sample
  double temp_C = 0;       ///< mean; NaN without a thermometer
};

/// How often what had to be done, since the engine started.
struct Attention {
  int retries = 0;      ///< poses measured again
  int recoveries = 0;   ///< of drive or sensor
  int suspensions = 0;  ///< a condition was not met
  int skipped = 0;      ///< steps put off to the end
  int left_out = 0;     ///< steps that could not be measured at all
  int suspects = 0;     ///< committed poses taken out again
};

struct Progress {
  storage::RunId run = 0;
  EngineState state = EngineState::idle;
  std::string reason;    ///< why the engine is in this state
  std::size_t step = 0;  ///< from 0
  std::size_t steps = 0;
  std::size_t done = 0;  ///< steps committed, those of an earlier session included
  storage::PoseKind kind = storage::PoseKind::grid;
  rig::HeadAngles target;
  rig::HeadStatus head;                ///< as read last
  double t_s = 0;                      ///< the run's clock
  std::uint64_t samples_received = 0;  ///< since the start, moving times included
  double planned_done_s = 0;           ///< by the plan's own timing
  double planned_total_s = 0;
  std::optional<RawSample> newest;
  Attention attention;
  std::optional<PoseMean> last_pose;  ///< the one committed last
  std::uint64_t events = 0;           ///< noted so far
  storage::EventRecord last_event;
};
/// Called on the engine's thread at every turn, every change of state and every event: must be
/// quick.
using ProgressObserver = std::function<void(const Progress&)>;

}  // namespace plumbline::app
