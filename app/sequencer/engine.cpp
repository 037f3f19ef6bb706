#include "app/sequencer/engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <thread>
#include <utility>

#include "app/provenance.h"

namespace plumbline::app {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// A move that takes so much longer than its profile has failed (sensor's clock).
constexpr double kMoveSlack = 2.0;
constexpr double kMoveSlack_s = 5.0;
constexpr double kHomingLimit_s = 180.0;
/// A pose whose consecutive samples have not come by then is started again.
constexpr double kSamplingSlack = 20.0;
constexpr double kSamplingSlack_s = 10.0;
/// How long a drive that has fallen silent is called again (host clock).
constexpr milliseconds kReconnectBudget{3000};
constexpr milliseconds kReconnectPause{200};
constexpr milliseconds kFirstSampleWait{100};

std::string angles_text(const rig::HeadAngles& angles) {
  return fmt::format("δ = {:.4f}°, h = {:.4f}°", angles.delta_deg, angles.h_deg);
}

std::string step_text(const PlanStep& step) {
  return fmt::format("pose {} ({}) at {}", step.ordinal, storage::to_string(step.kind),
                     angles_text(step.target));
}

bool drive_has_limits(const rig::SoftLimits& limits) {
  return limits.lower.delta_deg < limits.upper.delta_deg && limits.lower.h_deg < limits.upper.h_deg;
}

}  // namespace

const char* to_string(EngineState state) {
  switch (state) {
    case EngineState::idle:
      return "idle";
    case EngineState::homing:
      return "homing";
    case EngineState::moving:
      return "moving";
    case EngineState::settling:
      return "settling";
    case EngineState::sampling:
      return "sampling";
    case EngineState::recovering:
      return "recovering";
    case EngineState::stopping:
      return "stopping";
    case EngineState::finished:
      return "finished";
    case EngineState::stopped:
      return "stopped";
    case EngineState::failed:
      return "failed";
  }
  return "unknown";
}

Engine::Engine(rig::DividingHead& head, rig::Acquisition& acquisition, storage::RunStore& store,
               const EngineControl& control, const EngineOptions& options,
               ProgressObserver observer)
    : head_(head),
      acquisition_(acquisition),
      store_(store),
      control_(control),
      options_(options),
      observer_(std::move(observer)) {}

tl::unexpected<Engine::Interruption> Engine::repeat(std::string why) {
  return tl::unexpected(Interruption{Trouble::repeat, {ErrorCode::rig, std::move(why)}});
}

tl::unexpected<Engine::Interruption> Engine::give_up(Error error) {
  return tl::unexpected(Interruption{Trouble::give_up, std::move(error)});
}

tl::unexpected<Engine::Interruption> Engine::stop_asked_for() {
  return tl::unexpected(Interruption{Trouble::stop, {ErrorCode::rig, "stopped on request"}});
}

// --- the run as a whole --------------------------------------------------------------------------

Result<void> Engine::run(const Plan& plan, storage::RunId run, const StartPoint& start) {
  run_ = run;
  start_s_ = start.t_s;
  floor_ = start.floor;
  if (!floor_ && options_.settling.noise_V > 0) {
    floor_ =
        white_noise_floor(options_.settling.noise_V, options_.adc,
                          static_cast<std::size_t>(options_.settling.window), options_.rate_hz);
  }
  progress_ = {};
  progress_.steps = plan.steps.size();
  return end(execute(plan, start));
}

Engine::Outcome<void> Engine::execute(const Plan& plan, const StartPoint& start) {
  if (auto ready = start_up(plan); !ready) return ready;
  const double settle_s = shortest_settling_s(options_.settling, options_.rate_hz);
  progress_.planned_total_s =
      time_plan(plan, options_.motion, options_.rate_hz, settle_s).total_s();
  const PlanStep* previous = nullptr;
  for (const PlanStep& step : plan.steps) {
    progress_.step = static_cast<std::size_t>(step.ordinal);
    const bool stored =
        std::binary_search(start.committed.begin(), start.committed.end(), step.ordinal);
    if (!stored) {
      progress_.target = step.target;
      if (auto done = visit(step); !done) return done;
    }
    const double way_s =
        previous == nullptr ? 0 : travel_s(previous->target, step.target, options_.motion);
    progress_.planned_done_s += way_s + settle_s + step.samples / options_.rate_hz;
    previous = &step;
  }
  return {};
}

Engine::Outcome<void> Engine::start_up(const Plan& plan) {
  enter(EngineState::idle, "waiting for the sensor and the drive");
  if (auto heard = await_first_sample(); !heard) return heard;
  if (auto connected = asked(head_.connect()); !connected) return give_up(connected.error().error);
  auto limits = asked(head_.soft_limits());
  if (!limits) return give_up(limits.error().error);
  if (drive_has_limits(*limits)) {
    if (auto allowed = check_plan(plan, *limits); !allowed) return give_up(allowed.error());
  }
  auto status = asked(head_.status());
  if (!status) return give_up(status.error().error);
  if (status->alarm[0] != 0 || status->alarm[1] != 0) {
    note("fault",
         fmt::format("the drive starts with an alarm (δ {}, h {}); reset",
                     rig::alarm_text(status->alarm[0]), rig::alarm_text(status->alarm[1])));
    if (auto reset = asked(head_.reset_alarm()); !reset) return give_up(reset.error().error);
  }
  if (auto armed = asked(head_.arm_watchdog(options_.watchdog)); !armed) {
    return give_up(armed.error().error);
  }
  if (auto homed = home(); !homed) {
    // A first homing that fails is a rig that needs a person.
    if (homed.error().trouble == Trouble::repeat) return give_up(homed.error().error);
    return homed;
  }
  return {};
}

Engine::Outcome<void> Engine::await_first_sample() {
  while (!any_sample_) {
    if (control_.stop_requested()) {
      return stop_asked_for();
    }
    auto batch = acquisition_.take(kFirstSampleWait);
    if (!batch) return give_up(batch.error());
    if (batch->ended) {
      return give_up({ErrorCode::rig, "the recorded log of the sensor ended"});
    }
    if (batch->samples.empty()) continue;
    any_sample_ = true;
    newest_ = batch->samples.back();
    clock_offset_s_ = start_s_ - newest_.t_s;
    newest_.t_s = start_s_;
  }
  return {};
}

Engine::Outcome<void> Engine::home() {
  enter(EngineState::homing, "both axes");
  if (auto started = asked(head_.start_homing()); !started) return started;
  const double limit_s = newest_.t_s + kHomingLimit_s;
  for (;;) {
    if (auto turned = tick(); !turned) return turned;
    if (status_.homed && !status_.moving) return {};
    if (newest_.t_s > limit_s) {
      return repeat(
          fmt::format("homing has not ended within {:.0f} s; is an axis blocked?", kHomingLimit_s));
    }
  }
}

Result<void> Engine::end(const Outcome<void>& outcome) {
  enter(EngineState::stopping, outcome ? "the plan is done" : outcome.error().error.message);
  if (head_answers_) {
    auto stopped = head_.stop();
    if (stopped) stopped = head_.arm_watchdog(milliseconds{0});
    if (!stopped) note("fault", "no safe state confirmed: " + stopped.error().message);
  } else {
    note("fault", "the drive does not answer; its own watchdog stops the motors");
  }
  EngineState state = EngineState::finished;
  storage::RunState stored = storage::RunState::finished;
  if (!outcome) {
    const bool asked_for = outcome.error().trouble == Trouble::stop;
    state = asked_for ? EngineState::stopped : EngineState::failed;
    stored = asked_for ? storage::RunState::stopped : storage::RunState::failed;
  }
  enter(state, fmt::format("after step {} of {}", progress_.step, progress_.steps));
  auto closed = store_.finish_run(run_, stored, utc_now());
  if (!outcome) return fail(outcome.error().error);
  if (store_failure_) return fail(*store_failure_);
  return closed;
}

// --- one pose ------------------------------------------------------------------------------------

Engine::Outcome<void> Engine::visit(const PlanStep& step) {
  for (int attempt = 1;; ++attempt) {
    auto pose = measure(step);
    if (pose) return commit(*pose);
    Interruption interruption = pose.error();
    if (interruption.trouble != Trouble::repeat) return tl::unexpected(interruption);
    note("retry", fmt::format("{}, attempt {} of {}: {}", step_text(step), attempt,
                              options_.attempts_per_pose, interruption.error.message));
    if (attempt == options_.attempts_per_pose) {
      interruption.trouble = Trouble::give_up;
      interruption.error.message = fmt::format("{} failed {} times: {}", step_text(step), attempt,
                                               interruption.error.message);
      return tl::unexpected(interruption);
    }
    if (auto recovered = recover(interruption.error.message); !recovered) {
      if (recovered.error().trouble == Trouble::repeat) {
        return give_up(recovered.error().error);
      }
      return recovered;
    }
  }
}

Engine::Outcome<storage::PoseRecord> Engine::measure(const PlanStep& step) {
  enter(EngineState::moving, step_text(step));
  for (const rig::HeadAngles& position : step.via) {
    if (auto moved = move_to(position); !moved) return tl::unexpected(moved.error());
  }
  if (auto moved = move_to(step.target); !moved) return tl::unexpected(moved.error());

  auto settled = settle(step);
  if (!settled) return tl::unexpected(settled.error());
  storage::PoseRecord pose;
  pose.ordinal = step.ordinal;
  pose.kind = step.kind;
  pose.delta_deg = step.target.delta_deg;
  pose.h_deg = step.target.h_deg;
  pose.settle_s = settled->settle_s;
  pose.settle_capped = settled->capped;
  if (auto taken = take_samples(step, pose); !taken) return tl::unexpected(taken.error());
  pose.covariates = std::exchange(covariates_, {});
  return pose;
}

Engine::Outcome<void> Engine::move_to(const rig::HeadAngles& target) {
  if (auto turned = tick(); !turned) return turned;  // where the move starts
  const double profile_s = travel_s(status_.actual, target, options_.motion);
  if (auto started = asked(head_.start_move(target)); !started) return started;
  const double limit_s = newest_.t_s + kMoveSlack * profile_s + kMoveSlack_s;
  for (;;) {
    if (auto turned = tick(); !turned) return turned;
    if (status_.in_position) return check_arrival(target);
    if (newest_.t_s > limit_s) {
      return repeat(fmt::format("the head has not arrived at {} within {:.1f} s; it stands at {}",
                                angles_text(target), kMoveSlack * profile_s + kMoveSlack_s,
                                angles_text(status_.actual)));
    }
  }
}

Engine::Outcome<void> Engine::check_arrival(const rig::HeadAngles& target) const {
  const double tolerance_deg = options_.settling.angle_tolerance_deg;
  if (std::abs(status_.actual.delta_deg - target.delta_deg) <= tolerance_deg &&
      std::abs(status_.actual.h_deg - target.h_deg) <= tolerance_deg) {
    return {};
  }
  return repeat(fmt::format("the encoders say {} instead of {}, more than {}° off",
                            angles_text(status_.actual), angles_text(target), tolerance_deg));
}

Engine::Outcome<Engine::Settled> Engine::settle(const PlanStep& step) {
  enter(EngineState::settling, step_text(step));
  // What was sampled before the drive confirmed the position is still queued somewhere.
  if (auto received = receive(); !received) return tl::unexpected(received.error());
  fresh_.clear();
  const double arrival_s = newest_.t_s;
  double in_position_s = arrival_s;
  SettlingDetector detector(options_.settling, options_.adc, options_.rate_hz, floor_);
  for (;;) {
    if (auto turned = tick(); !turned) return tl::unexpected(turned.error());
    if (!status_.in_position) {  // still ringing: the hold starts again
      in_position_s = newest_.t_s;
      detector.restart();
      fresh_.clear();
    }
    for (auto sample = fresh_.begin(); sample != fresh_.end(); ++sample) {
      const bool held = sample->t_s - in_position_s > options_.settling.hold_s;
      const bool at_rest = held && detector.add(*sample);
      const bool capped = !at_rest && sample->t_s - arrival_s >= options_.settling.cap_s;
      if (!at_rest && !capped) continue;
      if (capped) {
        note("settle_cap", fmt::format("{}: not at rest after {} s; sampled all the same",
                                       step_text(step), options_.settling.cap_s));
      }
      const Settled settled{sample->t_s - arrival_s, capped};
      fresh_.erase(fresh_.begin(), std::next(sample));
      return settled;
    }
    fresh_.clear();
    if (newest_.t_s - arrival_s > options_.settling.cap_s && !status_.in_position) {
      return repeat(
          fmt::format("the head does not stay in position within {} s", options_.settling.cap_s));
    }
  }
}

Engine::Outcome<void> Engine::take_samples(const PlanStep& step, storage::PoseRecord& pose) {
  enter(EngineState::sampling, step_text(step));
  const auto wanted = static_cast<std::size_t>(step.samples);
  const double planned_before_s = progress_.planned_done_s;
  const double limit_s = newest_.t_s + kSamplingSlack_s +
                         (step.kind == storage::PoseKind::soak ? 2.0 : kSamplingSlack) *
                             step.samples / options_.rate_hz;
  rig::HeadAngles encoder_sum;
  int readings = 0;
  for (;;) {
    for (const RawSample& sample : fresh_) {
      if (pose.samples.size() == wanted) break;
      if (!pose.samples.empty() && sample.counter != pose.samples.back().counter + 1) {
        const bool soak = step.kind == storage::PoseKind::soak;
        note("loss",
             fmt::format("{}: {} samples lost after {} of {}; {}", step_text(step),
                         sample.counter - pose.samples.back().counter - 1, pose.samples.size(),
                         wanted, soak ? "the long record goes on" : "taken again"));
        if (!soak) {
          pose.samples.clear();
          encoder_sum = {};
          readings = 0;
        }
      }
      pose.samples.push_back(sample);
    }
    fresh_.clear();
    // The status is newer than the samples: it vouches for all of them.
    if (!status_.in_position) {
      return repeat("the head left its position while sampling");
    }
    if (auto there = check_arrival(step.target); !there) return there;
    encoder_sum.delta_deg += status_.actual.delta_deg;
    encoder_sum.h_deg += status_.actual.h_deg;
    ++readings;
    progress_.planned_done_s =
        planned_before_s + static_cast<double>(pose.samples.size()) / options_.rate_hz;
    if (pose.samples.size() == wanted) break;
    if (newest_.t_s > limit_s) {
      return repeat(
          fmt::format("{} consecutive samples have not come; the bus "
                      "loses too many",
                      wanted));
    }
    if (auto turned = tick(); !turned) return turned;
  }
  progress_.planned_done_s = planned_before_s;
  pose.delta_enc_deg = encoder_sum.delta_deg / readings;
  pose.h_enc_deg = encoder_sum.h_deg / readings;
  return {};
}

Engine::Outcome<void> Engine::commit(const storage::PoseRecord& pose) {
  if (auto done = store_.commit_pose(run_, pose); !done) {
    return give_up(done.error());
  }
  if (pose.kind == storage::PoseKind::soak && options_.settling.noise_V <= 0) {
    floor_ =
        learn_noise_floor(pose.samples, options_.adc,
                          static_cast<std::size_t>(options_.settling.window), options_.rate_hz);
  }
  return {};
}

// --- after a fault -------------------------------------------------------------------------------

Engine::Outcome<void> Engine::recover(const std::string& reason) {
  enter(EngineState::recovering, reason);
  if (!head_answers_) {
    if (auto back = reconnect(); !back) return back;
  }
  if (auto stopped = asked(head_.stop()); !stopped) return stopped;
  auto status = asked(head_.status());
  if (!status) return tl::unexpected(status.error());
  if (status->alarm[0] != 0 || status->alarm[1] != 0 || !status->ready) {
    if (auto reset = asked(head_.reset_alarm()); !reset) return reset;
    status = asked(head_.status());
    if (!status) return tl::unexpected(status.error());
  }
  if (auto armed = asked(head_.arm_watchdog(options_.watchdog)); !armed) return armed;
  if (!status->homed && !status->moving) return home();
  return {};
}

Engine::Outcome<void> Engine::reconnect() {
  const auto limit = Clock::now() + kReconnectBudget;
  for (;;) {
    if (control_.stop_requested()) {
      return stop_asked_for();
    }
    auto connected = asked(head_.connect());
    if (connected) {
      note("fault", "the drive answers again");
      return {};
    }
    if (Clock::now() > limit) {
      return give_up(connected.error().error);
    }
    std::this_thread::sleep_for(kReconnectPause);
  }
}

// --- the turn of every loop ----------------------------------------------------------------------

Engine::Outcome<void> Engine::tick() {
  std::this_thread::sleep_until(next_poll_);
  next_poll_ = Clock::now() + options_.poll_interval;
  if (control_.stop_requested()) {
    return stop_asked_for();
  }
  if (store_failure_) return give_up(*store_failure_);
  if (auto received = receive(); !received) return received;
  auto status = asked(head_.status());
  if (!status) return tl::unexpected(status.error());
  status_ = *status;
  report();
  if (status_.alarm[0] != 0 || status_.alarm[1] != 0) {
    return repeat(fmt::format("alarm of the drive (δ {}, h {})", rig::alarm_text(status_.alarm[0]),
                              rig::alarm_text(status_.alarm[1])));
  }
  return {};
}

Engine::Outcome<void> Engine::receive() {
  auto batch = acquisition_.take(milliseconds{0});
  if (!batch) return give_up(batch.error());
  for (RawSample& sample : batch->samples) {
    sample.t_s += clock_offset_s_;
    fresh_.push_back(sample);
  }
  for (const rig::CovariateReading& reading : batch->covariates) {
    covariates_.push_back({reading.name, reading.t_s + clock_offset_s_, reading.value});
  }
  progress_.samples_received += batch->samples.size();
  if (!batch->samples.empty()) {
    newest_ = batch->samples.back();
  } else if (batch->ended) {
    return give_up({ErrorCode::rig, "the recorded log of the sensor ended"});
  }
  return {};
}

template <class T>
Engine::Outcome<T> Engine::asked(Result<T> answer) {
  head_answers_ = answer.has_value();
  if (!answer) return tl::unexpected(Interruption{Trouble::repeat, answer.error()});
  if constexpr (std::is_void_v<T>) {
    return {};
  } else {
    return *std::move(answer);
  }
}

void Engine::enter(EngineState state, const std::string& text) {
  state_ = state;
  progress_.state = state;
  note("state", fmt::format("{}: {}", to_string(state), text));
  report();
}

void Engine::note(const std::string& kind, const std::string& text) {
  auto stored = store_.add_event(run_, {newest_.t_s, utc_now(), kind, text});
  if (!stored && !store_failure_) store_failure_ = stored.error();
}

void Engine::report() const {
  if (observer_) observer_(progress_);
}

}  // namespace plumbline::app
