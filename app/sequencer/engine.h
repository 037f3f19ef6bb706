// Executes a plan: moves the head, waits until the output is at rest, takes the samples, commits.
//
// What is done about what goes wrong, each noted as an event:
//   drive answers wrongly, late or not at all   connection made anew, the pose measured again; at
//       the start of a run tried attempts_per_pose times, of one that goes on for wait_s
//   alarm, stall, limit, watchdog               stop, alarm reset, the pose measured again
//   homing lost                                 homed again; the last committed pose is measured
//       once more, and if it has changed, the poses since the homing before that are affected are
//       searched for, taken out of the run and measured again
//   sensor silent, gone, restarted              motors stopped; waited for, then measured again
//   lost samples, stuck codes, saturation, an encoder that does not confirm the pose
//                                               the pose measured again
//   a pose that fails attempts_per_pose times   put off to the end of the plan, there tried again,
//       then left out; with more than skipped_poses of them the run ends
//   a condition of [[suspend]], a pause         motors stopped; the pose measured anew afterwards
//   the database cannot be written              the run ends at once
// Waiting in between grows with every failure; recoveries_per_run and wait_s bound it all.
#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "app/sequencer/control.h"
#include "app/sequencer/engine_report.h"
#include "app/sequencer/plan.h"
#include "app/sequencer/settling.h"
#include "app/sequencer/suspend.h"
#include "estimator/measurement.h"
#include "rig/acquisition.h"
#include "rig/dividing_head.h"
#include "storage/run_store.h"

namespace plumbline::app {

/// [recovery] of rig.toml.
struct RecoveryOptions {
  int attempts_per_pose = 3;
  int recoveries_per_run = 200;
  int skipped_poses = 5;
  double wait_s = 120;  ///< how long a silent drive or sensor is waited for, host clock
  /// How far a position that is measured once more may differ, in spans of the output over the
  /// poses so far; noise is allowed for besides.
  double compare_tolerance = 0.001;
};

struct EngineOptions {
  double rate_hz = 100;
  Adc adc;
  AxisMotion motion;  ///< what the head is told: decides how long a move may take
  SettlingOptions settling;
  RecoveryOptions recovery;
  std::vector<SuspendCondition> suspend;
  std::chrono::milliseconds poll_interval{20};  ///< of the drive's status
  std::chrono::milliseconds watchdog{3000};     ///< the drive's own; 0 = off
  bool home_end_latched = true;      ///< HOME END stays set after homing; see rig_config.h
  bool node_tells_identity = false;  ///< the node sends kIdentityColumn
};

/// Where a run starts, or goes on when it is resumed.
struct StartPoint {
  bool resumed = false;
  std::vector<long long> committed;  ///< ordinals that are stored already
  std::vector<long long> suspects;   ///< ordinals that were taken out again
  double t_s = 0;                    ///< the run's clock at the first sample that arrives
  std::optional<NoiseFloor> floor;   ///< learnt from a soak that is stored already
  std::vector<PoseMean> means;       ///< of the committed grid and verification poses
  std::optional<storage::RigIdentity> identity;  ///< whose rig the run was begun with
};

/// The step of the plan that a stored ordinal belongs to: a step that is measured again because its
/// pose was suspect gets its own number plus a multiple of the number of steps.
long long step_of(long long ordinal, std::size_t steps);

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
  /// stored. A failure says what ended the run: ErrorCode::rig for a fault of the rig, for a stop
  /// on request and for a rig that is not the one the run was begun with; storage for the
  /// database, input for a plan beyond the drive's soft limits.
  Result<void> run(const Plan& plan, storage::RunId run, const StartPoint& start = {});

 private:
  enum class Trouble {
    repeat,   ///< recover and measure the pose again
    hold,     ///< stop the motors and wait until the cause has passed
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

  // engine.cpp: the run as a whole.
  Outcome<void> execute(const Plan& plan, const StartPoint& start);
  void prepare(const Plan& plan, const StartPoint& start);
  Outcome<void> start_up(const Plan& plan, const StartPoint& start);
  Outcome<void> await_first_sample(bool resumed);
  Outcome<void> meet_drive(const Plan& plan, const StartPoint& start);
  Outcome<void> identify(const StartPoint& start);
  Outcome<void> compare_with_earlier(const StartPoint& start);
  const PlanStep* next_step(const Plan& plan, bool put_off) const;
  Outcome<void> home();
  /// Stops the motors, waits until they do stand still (unless aborted), and only then relieves the
  /// drive's watchdog.
  Outcome<void> stand_still();
  Result<void> end(const Outcome<void>& outcome);

  // engine_pose.cpp: one pose.
  Outcome<void> visit(const PlanStep& step, bool last_chance);
  Outcome<storage::PoseRecord> measured(const PlanStep& step);
  Outcome<storage::PoseRecord> measure(const PlanStep& step);
  Outcome<void> move_to(const rig::HeadAngles& target);
  Outcome<Settled> settle(const PlanStep& step);
  Outcome<void> take_samples(const PlanStep& step, storage::PoseRecord& pose);
  Outcome<void> commit(const PlanStep& step, storage::PoseRecord pose);
  Outcome<void> check_arrival(const rig::HeadAngles& target) const;

  // engine_recovery.cpp: after a fault, and while waiting.
  Outcome<void> recover(const std::string& reason, int attempt);
  Outcome<void> try_to_recover();
  Outcome<void> reconnect();
  Outcome<void> await_sensor();
  Outcome<void> hold(const std::string& reason);
  std::optional<std::string> reason_to_hold() const;
  Outcome<void> wait(std::chrono::milliseconds host_time);
  Outcome<void> back_off(int attempt);
  Outcome<void> check_reference();
  Outcome<std::optional<std::string>> changed_since(long long step);
  Outcome<void> take_out(const std::vector<long long>& steps, const std::string& why);
  PerAxis<double> span_V() const;

  // engine_loop.cpp: the turn of every loop.
  /// The samples that have arrived, then the drive's status, which is therefore newer than all of
  /// them.
  Outcome<void> tick();
  Outcome<void> receive();
  void use(rig::SampleBatch& batch);
  void watch_vibration(const RawSample& sample);
  /// Turns a failed request to the head into an interruption that is worth a repetition.
  template <class T>
  Outcome<T> asked(Result<T> answer) {
    head_answers_ = answer.has_value();
    if (!answer) return tl::unexpected(Interruption{Trouble::repeat, answer.error()});
    if constexpr (std::is_void_v<T>) {
      return {};
    } else {
      return *std::move(answer);
    }
  }
  void enter(EngineState state, const std::string& text);
  void note(const std::string& kind, const std::string& text);
  void report();

  rig::DividingHead& head_;
  rig::Acquisition& acquisition_;
  storage::RunStore& store_;
  const EngineControl& control_;
  EngineOptions options_;
  ProgressObserver observer_;

  // The run.
  storage::RunId run_ = 0;
  const Plan* plan_ = nullptr;
  Progress progress_;
  std::optional<NoiseFloor> floor_;
  std::map<long long, int> rounds_;      ///< of every step that was stored: how often, less one
  std::set<long long> done_;             ///< steps
  std::set<long long> put_off_;          ///< steps that come at the end
  std::set<long long> left_out_;         ///< steps that have failed there, too
  std::vector<double> planned_s_;        ///< by step
  std::map<long long, PoseMean> means_;  ///< by step, soak excepted
  std::vector<long long> since_homing_;  ///< steps measured since the reference was last confirmed
  std::optional<long long> soak_since_homing_;  ///< a soak that no later pose has vouched for
  bool reference_confirmed_ = false;            ///< poses before those agree with an earlier homing
  bool rehomed_ = false;                        ///< the reference has to be checked
  bool checking_ = false;
  bool holding_ = false;                ///< paused: what asks for a pause is not looked at
  std::optional<Error> store_failure_;  ///< of an event; ends the run at the next turn

  // The drive.
  rig::HeadStatus status_;
  bool head_answers_ = false;
  bool drive_is_there_ = false;  ///< it has told its name
  bool identified_ = false;
  bool homed_ = false;  ///< by us: a drive that is not, is in trouble
  int approach_ = 0;    ///< direction of the last δ motion
  std::chrono::steady_clock::time_point next_poll_;

  // The sensor.
  std::optional<Error> sensor_failure_;
  std::vector<RawSample> fresh_;  ///< arrived and not yet used, on the run's clock
  std::vector<storage::StoredCovariate> covariates_;  ///< since the last commit
  std::vector<RawSample> rest_window_;                ///< for the vibration at rest
  /// All frames that had arrived on this machine by then have been read.
  std::chrono::steady_clock::time_point read_up_to_;
  SuspendMonitor suspend_;
  std::string node_identity_;
  RawSample newest_;
  bool any_sample_ = false;
  double start_s_ = 0;         ///< the run's clock at the first sample
  double clock_offset_s_ = 0;  ///< from the node's clock to the run's
};

}  // namespace plumbline::app
