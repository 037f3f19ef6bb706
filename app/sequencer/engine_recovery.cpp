// After a fault, and while waiting for something to pass.
#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "app/sequencer/engine.h"
#include "app/sequencer/sample_guard.h"

namespace plumbline::app {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// Waiting before the n-th attempt at something: doubled each time, host clock.
constexpr milliseconds kShortestWait{100};
constexpr milliseconds kLongestWait{5000};
constexpr milliseconds kTurn{20};
/// A pose that is measured once more to be compared takes so many times the samples.
constexpr int kCheckSamples = 4;

milliseconds backoff(int attempt) {
  return std::min(kLongestWait, kShortestWait * (1 << std::min(attempt - 1, 10)));
}

Clock::duration seconds(double s) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
}

}  // namespace

Engine::Outcome<void> Engine::recover(const std::string& reason, int attempt) {
  enter(EngineState::recovering, reason);
  if (++progress_.attention.recoveries > options_.recovery.recoveries_per_run) {
    return give_up(
        {ErrorCode::rig, fmt::format("more than {} recoveries in one run (recoveries_per_run), the "
                                     "last: {}",
                                     options_.recovery.recoveries_per_run, reason)});
  }
  const auto limit = Clock::now() + seconds(options_.recovery.wait_s);
  std::string said;
  for (int round = attempt;; ++round) {
    if (round > 1) {
      if (auto waited = back_off(round - 1); !waited) return waited;
    }
    auto done = try_to_recover();
    if (done || done.error().trouble != Trouble::repeat) return done;
    const std::string& why = done.error().error.message;
    if (Clock::now() > limit) return give_up(done.error().error);
    if (why != said) note("fault", "not recovered yet: " + why);
    said = why;
  }
}

Engine::Outcome<void> Engine::try_to_recover() {
  if (!head_answers_) {
    if (auto back = reconnect(); !back) return back;
  }
  if (auto stopped = asked(head_.stop()); !stopped) return stopped;
  if (sensor_failure_) {
    if (auto heard = await_sensor(); !heard) return heard;
  }
  auto status = asked(head_.status());
  if (!status) return tl::unexpected(status.error());
  if (status->alarm[0] != 0 || status->alarm[1] != 0 || !status->ready) {
    if (auto reset = asked(head_.reset_alarm()); !reset) return reset;
    status = asked(head_.status());
    if (!status) return tl::unexpected(status.error());
  }
  if (auto armed = asked(head_.arm_watchdog(options_.watchdog)); !armed) return armed;
  if (!status->moving && (!homed_ || (!status->homed && options_.home_end_latched))) return home();
  return {};
}

Engine::Outcome<void> Engine::reconnect() {
  const auto limit = Clock::now() + seconds(options_.recovery.wait_s);
  for (int attempt = 1;; ++attempt) {
    auto connected = asked(head_.connect());
    if (connected) {
      note("fault", "the drive answers again");
      return {};
    }
    if (Clock::now() > limit) return give_up(connected.error().error);
    if (auto waited = back_off(attempt); !waited) return waited;
  }
}

Engine::Outcome<void> Engine::await_sensor() {
  const auto limit = Clock::now() + seconds(options_.recovery.wait_s);
  const Clock::time_point silent_since = Clock::now();
  for (int attempt = 1;; ++attempt) {
    Result<void> opened = acquisition_.start();
    bool listening = opened.has_value();
    while (listening) {
      if (control_.stop_requested()) return stop_asked_for();
      static_cast<void>(asked(head_.status()));  // keeps the drive's watchdog quiet
      auto batch = acquisition_.take(kTurn);
      if (!batch) {
        opened = fail(batch.error());
        break;
      }
      if (batch->ended) return give_up({ErrorCode::rig, "the recorded log of the sensor ended"});
      const bool heard = !batch->samples.empty();
      use(*batch);
      report();
      if (!heard) continue;
      sensor_failure_.reset();
      fresh_.clear();
      rest_window_.clear();
      note("fault",
           fmt::format("the sensor is heard again after {:.1f} s",
                       std::chrono::duration<double>(Clock::now() - silent_since).count()));
      return {};
    }
    if (Clock::now() > limit) return give_up(opened.error());
    if (auto waited = back_off(attempt); !waited) return waited;
  }
}

Engine::Outcome<void> Engine::back_off(int attempt) { return wait(backoff(attempt)); }

Engine::Outcome<void> Engine::wait(milliseconds host_time) {
  const auto until = Clock::now() + host_time;
  while (Clock::now() < until) {
    if (control_.stop_requested()) return stop_asked_for();
    // An answering drive must not take us for dead.
    if (head_answers_) static_cast<void>(asked(head_.status()));
    report();
    std::this_thread::sleep_for(
        std::min<Clock::duration>(options_.poll_interval, until - Clock::now()));
  }
  return {};
}

// --- pauses --------------------------------------------------------------------------------------

std::optional<std::string> Engine::reason_to_hold() const {
  if (control_.pause_requested() == EngineControl::Pause::now) return kPausedOnRequest;
  return suspend_.reason();
}

Engine::Outcome<void> Engine::hold(const std::string& reason) {
  const bool suspended = suspend_.reason().has_value();
  if (suspended) ++progress_.attention.suspensions;
  holding_ = true;
  const double since_s = newest_.t_s;
  enter(EngineState::paused, reason);
  note(suspended ? "suspend" : "pause", reason);
  auto stopped = asked(head_.stop());
  for (;;) {
    auto turned = stopped ? tick() : stopped;
    fresh_.clear();
    if (turned) {
      if (control_.pause_requested() == EngineControl::Pause::none && !suspend_.reason()) break;
      continue;
    }
    if (turned.error().trouble != Trouble::repeat) return turned;
    note("retry", "while paused: " + turned.error().error.message);
    if (auto recovered = recover(turned.error().error.message, 1); !recovered) return recovered;
    enter(EngineState::paused, reason);
    stopped = Outcome<void>{};
  }
  holding_ = false;
  note("go on", fmt::format("after {:.1f} s", newest_.t_s - since_s));
  return {};
}

// --- is the reference where it was? --------------------------------------------------------------

PerAxis<double> Engine::span_V() const {
  PerAxis<double> span{};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto [low, high] =
        std::minmax_element(means_.begin(), means_.end(), [axis](const auto& a, const auto& b) {
          return a.second.mean_V[axis] < b.second.mean_V[axis];
        });
    if (low != means_.end()) span[axis] = high->second.mean_V[axis] - low->second.mean_V[axis];
  }
  return span;
}

Engine::Outcome<std::optional<std::string>> Engine::changed_since(long long step) {
  PlanStep again = plan_->steps.at(static_cast<std::size_t>(step));
  again.samples *= kCheckSamples;
  progress_.step = static_cast<std::size_t>(step);
  progress_.kind = again.kind;
  progress_.target = again.target;
  const auto pose = measured(again);
  if (!pose) return tl::unexpected(pose.error());
  const auto difference = disagreement(means_.at(step), mean_of(*pose, step, options_.adc),
                                       span_V(), options_.recovery.compare_tolerance, options_.adc);
  note("check", difference.value_or(fmt::format("pose {} measured once more agrees", step)));
  return difference;
}

Engine::Outcome<void> Engine::check_reference() {
  // A shaft that slips during the soak leaves a step in the long record that no later pose shows.
  std::vector<long long> wrong;
  if (since_homing_.empty()) {
    rehomed_ = false;
    if (soak_since_homing_) wrong.push_back(*std::exchange(soak_since_homing_, std::nullopt));
    return take_out(wrong, "the homing was lost before a pose could be compared");
  }
  checking_ = true;
  // The first pose that has changed, by halving: those before a slip are right, those after it not.
  // The last one is looked at first, because mostly nothing has changed.
  std::size_t good = 0;                    // so many from the front are known to be right
  std::size_t bad = since_homing_.size();  // from here on known to be wrong
  std::size_t look = since_homing_.size() - 1;
  std::string why;
  while (good < bad) {
    const auto changed = changed_since(since_homing_[look]);
    if (!changed) {
      checking_ = false;
      return tl::unexpected(changed.error());
    }
    if (*changed) {
      bad = look;
      why = **changed;
    } else {
      good = look + 1;
    }
    look = good + (bad - good) / 2;
  }
  if (good == 0 && reference_confirmed_) {
    // Either all of them are wrong or the new reference is: an older pose decides.
    const auto older = std::find_if(means_.rbegin(), means_.rend(), [&](const auto& known) {
      return std::find(since_homing_.begin(), since_homing_.end(), known.first) ==
             since_homing_.end();
    });
    Outcome<std::optional<std::string>> changed = std::optional<std::string>(why);
    if (older != means_.rend()) changed = changed_since(older->first);
    checking_ = false;
    if (!changed) return tl::unexpected(changed.error());
    if (*changed) {
      return give_up({ErrorCode::rig, fmt::format("the head's reference is no longer where it was: "
                                                  "{}; the run has to be measured anew",
                                                  **changed)});
    }
  }
  checking_ = false;
  if (good == 0 && soak_since_homing_) wrong.push_back(*soak_since_homing_);
  soak_since_homing_.reset();
  wrong.insert(wrong.end(), since_homing_.begin() + static_cast<std::ptrdiff_t>(bad),
               since_homing_.end());
  since_homing_.resize(good);
  if (good > 0) {
    since_homing_ = {since_homing_.back()};
    reference_confirmed_ = true;
  }
  rehomed_ = false;
  return take_out(wrong, why);
}

Engine::Outcome<void> Engine::take_out(const std::vector<long long>& steps,
                                       const std::string& why) {
  for (const long long step : steps) {
    const long long ordinal = step + rounds_[step] * static_cast<long long>(progress_.steps);
    note("suspect", fmt::format("pose {} is taken out and measured again: {}", step, why));
    if (auto done = store_.suspect_pose(run_, ordinal, why); !done) return give_up(done.error());
    ++rounds_[step];
    done_.erase(step);
    means_.erase(step);
    progress_.done = done_.size();
    progress_.planned_done_s -= planned_s_.at(static_cast<std::size_t>(step));
    ++progress_.attention.suspects;
  }
  return {};
}

}  // namespace plumbline::app
