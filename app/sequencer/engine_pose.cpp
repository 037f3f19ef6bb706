// One pose: the way there, rest, samples, commit.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "app/sequencer/engine.h"
#include "app/sequencer/sample_guard.h"

namespace plumbline::app {

using Clock = std::chrono::steady_clock;

namespace {

/// A move that takes so much longer than its profile has failed (sensor's clock).
constexpr double kMoveSlack = 2.0;
constexpr double kMoveSlack_s = 5.0;
/// A pose whose consecutive samples have not come by then is started again.
constexpr double kSamplingSlack = 20.0;
constexpr double kSamplingSlack_s = 10.0;
/// A motion of δ shorter than this presses no flank against another.
constexpr double kMotion_deg = 0.01;

std::string angles_text(const rig::HeadAngles& angles) {
  return fmt::format("δ = {:.4f}°, h = {:.4f}°", angles.delta_deg, angles.h_deg);
}

std::string step_text(const PlanStep& step) {
  return fmt::format("pose {} ({}) at {}", step.ordinal, storage::to_string(step.kind),
                     angles_text(step.target));
}

}  // namespace

Engine::Outcome<void> Engine::visit(const PlanStep& step, bool last_chance) {
  progress_.step = static_cast<std::size_t>(step.ordinal);
  progress_.kind = step.kind;
  progress_.target = step.target;
  auto pose = measured(step);
  if (pose) return commit(step, *std::move(pose));
  if (pose.error().trouble != Trouble::repeat) return tl::unexpected(pose.error());
  const std::string& why = pose.error().error.message;
  // Everything after the soak is judged by it: nothing goes without.
  const bool may_skip = step.kind != storage::PoseKind::soak;
  const std::set<long long>& others = last_chance ? left_out_ : put_off_;
  if (!may_skip || static_cast<int>(others.size()) >= options_.recovery.skipped_poses) {
    return give_up({ErrorCode::rig, why});
  }
  if (last_chance) {
    left_out_.insert(step.ordinal);
    ++progress_.attention.left_out;
    note("left out", why);
  } else {
    put_off_.insert(step.ordinal);
    ++progress_.attention.skipped;
    note("put off", why + "; tried again at the end");
  }
  return {};
}

Engine::Outcome<storage::PoseRecord> Engine::measured(const PlanStep& step) {
  const int attempts = options_.recovery.attempts_per_pose;
  for (int attempt = 1;;) {
    Outcome<storage::PoseRecord> pose;
    Outcome<void> checked = rehomed_ && !checking_ ? check_reference() : Outcome<void>{};
    pose = checked ? measure(step) : tl::unexpected(checked.error());
    if (pose) return pose;
    Interruption interruption = pose.error();
    if (interruption.trouble == Trouble::hold) {
      if (auto held = hold(interruption.error.message); !held) return tl::unexpected(held.error());
      continue;
    }
    if (interruption.trouble != Trouble::repeat) return tl::unexpected(interruption);
    ++progress_.attention.retries;
    note("retry", fmt::format("{}, attempt {} of {}: {}", step_text(step), attempt, attempts,
                              interruption.error.message));
    // After the last attempt, too: the next pose starts with a rig that works.
    auto recovered = recover(interruption.error.message, attempt);
    if (!recovered && recovered.error().trouble == Trouble::hold) {
      recovered = hold(recovered.error().error.message);
    }
    if (!recovered) return tl::unexpected(recovered.error());
    if (attempt++ < attempts) continue;
    interruption.error.message = fmt::format("{} failed {} times: {}", step_text(step), attempts,
                                             interruption.error.message);
    return tl::unexpected(interruption);
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
  pose.kind = step.kind;
  pose.delta_deg = step.target.delta_deg;
  pose.h_deg = step.target.h_deg;
  pose.approach = approach_;
  pose.settle_s = settled->settle_s;
  pose.settle_capped = settled->capped;
  if (auto taken = take_samples(step, pose); !taken) return tl::unexpected(taken.error());
  if (const auto why = implausible(pose.samples, options_.adc, floor_)) return repeat(*why);
  pose.covariates = std::exchange(covariates_, {});
  return pose;
}

Engine::Outcome<void> Engine::move_to(const rig::HeadAngles& target) {
  if (auto turned = tick(); !turned) return turned;  // where the move starts
  const double profile_s = travel_s(status_.actual, target, options_.motion);
  const double turn_deg = target.delta_deg - status_.actual.delta_deg;
  if (std::abs(turn_deg) > kMotion_deg) approach_ = turn_deg > 0 ? 1 : -1;
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
  // What was sampled before the drive confirmed the position may still wait in a queue of the
  // kernel or of ours, on a busy machine long enough to pass for samples of a head at rest. Samples
  // count from when all that had arrived by the confirmation has been read.
  auto confirmed = Clock::now();
  bool waiting = true;  // for the samples of a head at rest
  double arrival_s = newest_.t_s;
  double in_position_s = arrival_s;
  SettlingDetector detector(options_.settling, options_.adc, options_.rate_hz, floor_);
  for (;;) {
    if (auto turned = tick(); !turned) return tl::unexpected(turned.error());
    if (!status_.in_position) {  // still ringing: the hold starts again
      confirmed = Clock::now();
      waiting = true;
    }
    if (waiting) {
      // What has come with the last of the old ones may be old, too.
      waiting = read_up_to_ <= confirmed;
      in_position_s = newest_.t_s;
      detector.restart();
      fresh_.clear();
    }
    for (auto sample = fresh_.begin(); sample != fresh_.end(); ++sample) {
      const bool held = sample->t_s - in_position_s > options_.settling.hold_s;
      const bool at_rest = held && detector.add(*sample);
      const bool capped = !at_rest && sample->t_s - arrival_s >= options_.settling.cap_s;
      if (!at_rest && !capped) continue;
      // A converter that hangs since the last pose looks like rest, and may come back too soon for
      // the samples alone to show it.
      if (const auto why = implausible(detector.window(), options_.adc, floor_))
        return repeat(*why);
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
  const auto interrupted = [&](const Interruption& why) -> Outcome<void> {
    progress_.planned_done_s = planned_before_s;
    return tl::unexpected(why);
  };
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
      return interrupted(
          {Trouble::repeat, {ErrorCode::rig, "the head left its position while sampling"}});
    }
    if (auto there = check_arrival(step.target); !there) return interrupted(there.error());
    encoder_sum.delta_deg += status_.actual.delta_deg;
    encoder_sum.h_deg += status_.actual.h_deg;
    ++readings;
    if (!checking_) {
      progress_.planned_done_s =
          planned_before_s + static_cast<double>(pose.samples.size()) / options_.rate_hz;
    }
    if (pose.samples.size() == wanted) break;
    if (newest_.t_s > limit_s) {
      return interrupted(
          {Trouble::repeat,
           {ErrorCode::rig, fmt::format("{} consecutive samples have not come; the bus loses too "
                                        "many",
                                        wanted)}});
    }
    if (auto turned = tick(); !turned) return interrupted(turned.error());
  }
  progress_.planned_done_s = planned_before_s;
  pose.delta_enc_deg = encoder_sum.delta_deg / readings;
  pose.h_enc_deg = encoder_sum.h_deg / readings;
  return {};
}

Engine::Outcome<void> Engine::commit(const PlanStep& step, storage::PoseRecord pose) {
  pose.ordinal = step.ordinal + rounds_[step.ordinal] * static_cast<long long>(progress_.steps);
  if (auto done = store_.commit_pose(run_, pose); !done) return give_up(done.error());
  done_.insert(step.ordinal);
  put_off_.erase(step.ordinal);
  progress_.done = done_.size();
  progress_.planned_done_s += planned_s_.at(static_cast<std::size_t>(step.ordinal));
  progress_.last_pose = mean_of(pose, step.ordinal, options_.adc);
  if (pose.kind != storage::PoseKind::soak) {
    means_[step.ordinal] = *progress_.last_pose;
    since_homing_.push_back(step.ordinal);
  } else {
    soak_since_homing_ = step.ordinal;
    if (options_.settling.noise_V <= 0) {
      floor_ =
          learn_noise_floor(pose.samples, options_.adc,
                            static_cast<std::size_t>(options_.settling.window), options_.rate_hz);
    }
  }
  report();
  return {};
}

}  // namespace plumbline::app
