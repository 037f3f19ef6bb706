// Executes a plan: moves the head, waits until the output is at rest, takes the samples, commits.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/sequencer/plan.h"
#include "app/sequencer/settling.h"
#include "estimator/measurement.h"
#include "rig/acquisition.h"
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
  recovering,  ///< after a fault, before the pose is measured again
  stopping,    ///< bringing the motors into the safe state
  finished,    ///< the plan is done
  stopped,     ///< ended on request; resumable
  failed,      ///< ended by a fault; resumable
};
const char* to_string(EngineState state);

/// Orders to a running engine from a signal handler or another thread.
class EngineControl {
 public:
  void request_stop() noexcept { stop_.store(true, std::memory_order_relaxed); }
  bool stop_requested() const noexcept { return stop_.load(std::memory_order_relaxed); }

 private:
  static_assert(std::atomic<bool>::is_always_lock_free, "set from a signal handler");
  std::atomic<bool> stop_{false};
};

struct EngineOptions {
  double rate_hz = 100;
  Adc adc;
  AxisMotion motion;  ///< what the head is told: decides how long a move may take
  SettlingOptions settling;
  std::chrono::milliseconds poll_interval{20};  ///< of the drive's status
  std::chrono::milliseconds watchdog{3000};     ///< the drive's own; 0 = off
  int attempts_per_pose = 3;
};

/// What is going on, for a display.
struct Progress {
  EngineState state = EngineState::idle;
  std::size_t step = 0;  ///< from 0
  std::size_t steps = 0;
  rig::HeadAngles target;
  std::uint64_t samples_received = 0;  ///< since the start, moving times included
  double planned_done_s = 0;           ///< by the plan's own timing
  double planned_total_s = 0;
};
using ProgressObserver = std::function<void(const Progress&)>;

/// Where a run starts, or goes on when it is resumed.
struct StartPoint {
  std::vector<long long> committed;  ///< ordinals that are stored already
  double t_s = 0;                    ///< the run's clock at the first sample that arrives
  std::optional<NoiseFloor> floor;   ///< learnt from a soak that is stored already
};

/// One engine executes one run. It owns the head and the writing connection while it runs; the
/// samples come from the acquisition's own thread. All dwell times and motion deadlines are
/// measured on the sensor's clock, so that a rig faster than real time needs nothing special.
class Engine {
 public:
  Engine(rig::DividingHead& head, rig::Acquisition& acquisition, storage::RunStore& store,
         const EngineControl& control, const EngineOptions& options,
         ProgressObserver observer = {});

  /// Measures every step of the plan that is not committed yet, one commit per pose. Ends in the
  /// safe state whatever happens: motors stopped, the drive's watchdog off again, the run's state
  /// stored. A failure says what ended the run: ErrorCode::rig for a fault of the rig and for a
  /// stop on request, storage for the database, input for a plan beyond the drive's soft limits.
  Result<void> run(const Plan& plan, storage::RunId run, const StartPoint& start = {});

 private:
  enum class Trouble {
    repeat,   ///< recover and measure the pose again
    stop,     ///< asked for from outside
    give_up,  ///< end in the safe state
  };
  struct Interruption {
    Trouble trouble = Trouble::give_up;
    Error error;
  };
  template <class T>
  using Outcome = tl::expected<T, Interruption>;
  static tl::unexpected<Interruption> repeat(std::string why);
  static tl::unexpected<Interruption> give_up(Error error);
  static tl::unexpected<Interruption> stop_asked_for();

  struct Settled {
    double settle_s = 0;
    bool capped = false;
  };

  Outcome<void> execute(const Plan& plan, const StartPoint& start);
  Outcome<void> start_up(const Plan& plan);
  Outcome<void> await_first_sample();
  Outcome<void> home();
  Outcome<void> visit(const PlanStep& step);
  Outcome<storage::PoseRecord> measure(const PlanStep& step);
  Outcome<void> move_to(const rig::HeadAngles& target);
  Outcome<Settled> settle(const PlanStep& step);
  Outcome<void> take_samples(const PlanStep& step, storage::PoseRecord& pose);
  Outcome<void> commit(const storage::PoseRecord& pose);
  Outcome<void> recover(const std::string& reason);
  Outcome<void> reconnect();
  Result<void> end(const Outcome<void>& outcome);

  /// One turn of every waiting loop: the samples that have arrived, then the drive's status, which
  /// is therefore newer than all of them.
  Outcome<void> tick();
  Outcome<void> receive();
  /// Turns a failed request to the head into an interruption that is worth a repetition.
  template <class T>
  Outcome<T> asked(Result<T> answer);
  Outcome<void> check_arrival(const rig::HeadAngles& target) const;

  void enter(EngineState state, const std::string& text);
  void note(const std::string& kind, const std::string& text);
  void report() const;

  rig::DividingHead& head_;
  rig::Acquisition& acquisition_;
  storage::RunStore& store_;
  const EngineControl& control_;
  EngineOptions options_;
  ProgressObserver observer_;

  storage::RunId run_ = 0;
  EngineState state_ = EngineState::idle;
  Progress progress_;
  std::optional<NoiseFloor> floor_;
  rig::HeadStatus status_;
  bool head_answers_ = false;
  std::optional<Error> store_failure_;  ///< of an event; ends the run at the next turn
  std::chrono::steady_clock::time_point next_poll_;

  std::vector<RawSample> fresh_;  ///< arrived and not yet used, on the run's clock
  std::vector<storage::StoredCovariate> covariates_;  ///< since the last commit
  RawSample newest_;
  bool any_sample_ = false;
  double start_s_ = 0;         ///< the run's clock at the first sample
  double clock_offset_s_ = 0;  ///< from the node's clock to the run's
};

}  // namespace plumbline::app
