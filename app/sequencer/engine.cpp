// The run as a whole: start, order of the steps, end.
#include "app/sequencer/engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <utility>

#include "app/provenance.h"

namespace plumbline::app {

namespace {

using std::chrono::milliseconds;

constexpr double kHomingLimit_s = 180.0;
constexpr int kStandstillLimit_s = 5;  // of the host's clock: a drive that was told to stop brakes
constexpr milliseconds kFirstSampleWait{100};
/// Nodes send their identity about once a second (sensor's clock).
constexpr double kIdentityWait_s = 10.0;
constexpr std::size_t kComparedPoses = 3;

bool drive_has_limits(const rig::SoftLimits& limits) {
  return limits.lower.delta_deg < limits.upper.delta_deg && limits.lower.h_deg < limits.upper.h_deg;
}

/// What both state, must agree; an end that states nothing is not compared.
std::optional<std::string> other_rig(const storage::RigIdentity& before,
                                     const storage::RigIdentity& now) {
  const auto differs = [](const std::string& a, const std::string& b) {
    return !a.empty() && !b.empty() && a != b;
  };
  if (differs(before.drive, now.drive)) {
    return fmt::format("the drive is {} and was {}", now.drive, before.drive);
  }
  if (differs(before.node, now.node)) {
    return fmt::format("the node is {} and was {}", now.node, before.node);
  }
  return std::nullopt;
}

std::string or_unknown(const std::string& text) { return text.empty() ? "not stated" : text; }

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
    case EngineState::paused:
      return "paused";
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

long long step_of(long long ordinal, std::size_t steps) {
  return ordinal % static_cast<long long>(steps);
}

Engine::Engine(rig::DividingHead& head, rig::Acquisition& acquisition, storage::RunStore& store,
               const EngineControl& control, const EngineOptions& options,
               ProgressObserver observer)
    : head_(head),
      acquisition_(acquisition),
      store_(store),
      control_(control),
      options_(options),
      observer_(std::move(observer)),
      suspend_(options.suspend) {}

tl::unexpected<Engine::Interruption> Engine::repeat(std::string why) {
  return tl::unexpected(Interruption{Trouble::repeat, {ErrorCode::rig, std::move(why)}});
}

tl::unexpected<Engine::Interruption> Engine::give_up(Error error) {
  return tl::unexpected(Interruption{Trouble::give_up, std::move(error)});
}

tl::unexpected<Engine::Interruption> Engine::stop_asked_for() {
  return tl::unexpected(Interruption{Trouble::stop, {ErrorCode::rig, "stopped on request"}});
}

Result<void> Engine::run(const Plan& plan, storage::RunId run, const StartPoint& start) {
  assert(!plan.steps.empty());
  run_ = run;
  prepare(plan, start);
  return end(execute(plan, start));
}

void Engine::prepare(const Plan& plan, const StartPoint& start) {
  plan_ = &plan;
  start_s_ = start.t_s;
  newest_.t_s = start.t_s;
  floor_ = start.floor;
  if (!floor_ && options_.settling.noise_V > 0) {
    floor_ =
        white_noise_floor(options_.settling.noise_V, options_.adc,
                          static_cast<std::size_t>(options_.settling.window), options_.rate_hz);
  }
  progress_ = {};
  progress_.run = run_;
  progress_.steps = plan.steps.size();
  const double settle_s = shortest_settling_s(options_.settling, options_.rate_hz);
  const PlanStep* previous = nullptr;
  for (const PlanStep& step : plan.steps) {
    const double way_s =
        previous == nullptr ? 0 : travel_s(previous->target, step.target, options_.motion);
    planned_s_.push_back(way_s + settle_s + step.samples / options_.rate_hz);
    progress_.planned_total_s += planned_s_.back();
    previous = &step;
  }
  for (const long long ordinal : start.suspects) ++rounds_[step_of(ordinal, plan.steps.size())];
  for (const long long ordinal : start.committed) {
    const long long step = step_of(ordinal, plan.steps.size());
    done_.insert(step);
    progress_.planned_done_s += planned_s_.at(static_cast<std::size_t>(step));
  }
  progress_.done = done_.size();
  for (const PoseMean& mean : start.means) means_[mean.step] = mean;
  reference_confirmed_ = !means_.empty();
}

Engine::Outcome<void> Engine::execute(const Plan& plan, const StartPoint& start) {
  if (auto ready = start_up(plan, start); !ready) return ready;
  if (auto same = compare_with_earlier(start); !same) return same;
  for (const bool last_chance : {false, true}) {
    while (const PlanStep* step = next_step(plan, last_chance)) {
      if (control_.pause_requested() != EngineControl::Pause::none) {
        if (auto held = hold(kPausedOnRequest); !held) return held;
      }
      if (auto done = visit(*step, last_chance); !done) return done;
    }
  }
  return {};
}

const PlanStep* Engine::next_step(const Plan& plan, bool put_off) const {
  for (const PlanStep& step : plan.steps) {
    if (done_.contains(step.ordinal) || left_out_.contains(step.ordinal)) continue;
    if (put_off || !put_off_.contains(step.ordinal)) return &step;
  }
  return nullptr;
}

Engine::Outcome<void> Engine::start_up(const Plan& plan, const StartPoint& start) {
  enter(EngineState::idle, "waiting for the sensor and the drive");
  if (auto heard = await_first_sample(start.resumed); !heard) return heard;
  // At a new run somebody stands beside it, who learns soon that the drive is not there at all. A
  // drive that has told its name is there; and a run that goes on does so by itself in the night,
  // after a power cut perhaps while the drive is still starting.
  const auto limit =
      std::chrono::steady_clock::now() + std::chrono::duration<double>(options_.recovery.wait_s);
  for (int attempt = 1;; ++attempt) {
    auto met = meet_drive(plan, start);
    if (met) break;
    if (met.error().trouble != Trouble::repeat) return met;
    const bool again = start.resumed || drive_is_there_
                           ? std::chrono::steady_clock::now() < limit
                           : attempt < options_.recovery.attempts_per_pose;
    if (!again) return give_up(met.error().error);
    note("retry", fmt::format("start, attempt {}: {}", attempt, met.error().error.message));
    if (auto waited = back_off(attempt); !waited) return waited;
    if (!sensor_failure_) continue;
    if (auto heard = await_sensor(); !heard) return heard;
  }
  for (int attempt = 1;; ++attempt) {
    auto homed = attempt == 1 ? home() : recover("the first homing failed", attempt);
    if (homed && homed_) return {};
    if (homed) continue;
    if (homed.error().trouble == Trouble::hold) {
      if (auto held = hold(homed.error().error.message); !held) return held;
      --attempt;
      continue;
    }
    if (homed.error().trouble != Trouble::repeat) return homed;
    note("retry", fmt::format("homing, attempt {} of {}: {}", attempt,
                              options_.recovery.attempts_per_pose, homed.error().error.message));
    if (attempt >= options_.recovery.attempts_per_pose) return give_up(homed.error().error);
  }
}

Engine::Outcome<void> Engine::meet_drive(const Plan& plan, const StartPoint& start) {
  if (auto connected = asked(head_.connect()); !connected) return connected;
  if (auto known = identify(start); !known) return known;
  auto limits = asked(head_.soft_limits());
  if (!limits) return tl::unexpected(limits.error());
  if (drive_has_limits(*limits)) {
    if (auto allowed = check_plan(plan, *limits); !allowed) return give_up(allowed.error());
  }
  auto status = asked(head_.status());
  if (!status) return tl::unexpected(status.error());
  if (status->alarm[0] != 0 || status->alarm[1] != 0) {
    note("fault",
         fmt::format("the drive starts with an alarm (δ {}, h {}); reset",
                     rig::alarm_text(status->alarm[0]), rig::alarm_text(status->alarm[1])));
    if (auto reset = asked(head_.reset_alarm()); !reset) return reset;
  }
  return asked(head_.arm_watchdog(options_.watchdog));
}

Engine::Outcome<void> Engine::await_first_sample(bool resumed) {
  while (!any_sample_) {
    if (control_.stop_requested()) return stop_asked_for();
    auto batch = acquisition_.take(kFirstSampleWait);
    if (!batch && resumed) {
      note("retry", "start: " + batch.error().message);
      if (auto heard = await_sensor(); !heard) return heard;
      continue;
    }
    if (!batch) return give_up(batch.error());
    if (batch->ended) return give_up({ErrorCode::rig, "the recorded log of the sensor ended"});
    use(*batch);
    report();
  }
  return {};
}

Engine::Outcome<void> Engine::identify(const StartPoint& start) {
  if (identified_) return {};
  auto drive = asked(head_.identity());
  if (!drive) return tl::unexpected(drive.error());
  drive_is_there_ = true;
  const double limit_s = newest_.t_s + kIdentityWait_s;
  while (options_.node_tells_identity && node_identity_.empty() && newest_.t_s < limit_s) {
    if (control_.stop_requested()) return stop_asked_for();
    if (auto received = receive(); !received) return received;
    if (auto waited = wait(options_.poll_interval); !waited) return waited;
  }
  const storage::RigIdentity now{*drive, node_identity_};
  note("identity", fmt::format("drive {}, node {}", or_unknown(now.drive), or_unknown(now.node)));
  if (!start.identity) {
    if (auto stored = store_.set_identity(run_, now); !stored) return give_up(stored.error());
  } else if (const auto other = other_rig(*start.identity, now)) {
    return give_up({ErrorCode::rig, fmt::format("the run cannot be resumed on another rig: {}; "
                                                "start a new run without --resume",
                                                *other)});
  }
  identified_ = true;
  return {};
}

Engine::Outcome<void> Engine::compare_with_earlier(const StartPoint& start) {
  std::vector<PoseMean> known = start.means;
  std::sort(known.begin(), known.end(),
            [](const PoseMean& a, const PoseMean& b) { return a.t_s < b.t_s; });
  std::set<std::size_t> chosen;
  for (std::size_t i = 0; i < kComparedPoses && !known.empty(); ++i) {
    chosen.insert(i * (known.size() - 1) / (kComparedPoses - 1));
  }
  checking_ = true;
  for (const std::size_t index : chosen) {
    const auto changed = changed_since(known[index].step);
    if (!changed) return tl::unexpected(changed.error());
    if (!*changed) continue;
    return give_up(
        {ErrorCode::rig,
         fmt::format("the run cannot be resumed: {}; is it the same unit, mounted as before?",
                     **changed)});
  }
  if (!chosen.empty()) {
    note("check", fmt::format("{} earlier poses measured again agree", chosen.size()));
  }
  checking_ = false;
  rehomed_ = false;
  return {};
}

Engine::Outcome<void> Engine::home() {
  enter(EngineState::homing, "both axes");
  homed_ = false;
  if (auto started = asked(head_.start_homing()); !started) return started;
  const double limit_s = newest_.t_s + kHomingLimit_s;
  for (;;) {
    if (auto turned = tick(); !turned) return turned;
    if (status_.homed && !status_.moving) break;
    if (newest_.t_s > limit_s) {
      return repeat(
          fmt::format("homing has not ended within {:.0f} s; is an axis blocked?", kHomingLimit_s));
    }
  }
  homed_ = true;
  rehomed_ = !since_homing_.empty() || soak_since_homing_;
  return {};
}

Engine::Outcome<void> Engine::stand_still() {
  if (auto stopped = asked(head_.stop()); !stopped) return stopped;
  using Clock = std::chrono::steady_clock;
  const auto limit = Clock::now() + std::chrono::seconds{kStandstillLimit_s};
  while (!control_.abort_requested()) {
    auto status = asked(head_.status());
    if (!status) return tl::unexpected(status.error());
    if (!status->moving) break;
    if (Clock::now() > limit)
      return repeat(
          fmt::format("the head still moves {} s after it was stopped", kStandstillLimit_s));
    std::this_thread::sleep_for(options_.poll_interval);
  }
  return asked(head_.arm_watchdog(milliseconds{0}));
}

Result<void> Engine::end(const Outcome<void>& outcome) {
  enter(EngineState::stopping, outcome ? "the plan is done" : outcome.error().error.message);
  // Whoever asks to stop wants to know that the motors stand still; whoever aborts, has no time.
  if (!head_answers_ && !control_.abort_requested()) static_cast<void>(asked(head_.connect()));
  if (auto safe = stand_still(); !safe) {
    note("fault",
         fmt::format("no safe state confirmed ({}); the drive's own watchdog stops the motors",
                     safe.error().error.message));
  }
  const rig::SourceStatistics bus = acquisition_.statistics();
  note("bus", fmt::format("{} samples received, {} lost; {} wrong checksums, {} out of order, {} "
                          "unpaired, {} dropped by the kernel, {} by the queue, {} error frames",
                          bus.samples, bus.lost_samples, bus.crc_errors, bus.out_of_order,
                          bus.unpaired, bus.kernel_drops, bus.queue_drops, bus.error_frames));
  EngineState state = EngineState::finished;
  storage::RunState stored = storage::RunState::finished;
  if (!outcome) {
    const bool asked_for = outcome.error().trouble == Trouble::stop;
    state = asked_for ? EngineState::stopped : EngineState::failed;
    stored = asked_for ? storage::RunState::stopped : storage::RunState::failed;
  }
  enter(state, fmt::format("{} of {} steps done", done_.size(), progress_.steps));
  auto closed = store_.finish_run(run_, stored, utc_now());
  if (!outcome) return fail(outcome.error().error);
  if (store_failure_) return fail(*store_failure_);
  return closed;
}

}  // namespace plumbline::app
