#include "rig/sim/machine.h"

#include <algorithm>

namespace plumbline::sim {

namespace {

/// Longest step of the world, in seconds of the host: longer than any pause of a node's thread on a
/// machine that keeps up.
constexpr double kLongestStep_s = 0.05;
/// A node whose thread gets no time, or whose receiver does not read, may need seconds for a burst.
/// A reply that overtakes it vouches for a position that the samples after it do not have.
constexpr std::chrono::seconds kLongestHold{30};

// A master that has polled and is not heard for a moment has no time to look, or waits for a reply
// that a fault keeps from it. A world at 100x would be elsewhere when it looks again, so an
// accelerated one waits for it; a master that is silent for longer has gone.
constexpr std::chrono::milliseconds kMasterIsBusy{50};
constexpr std::chrono::seconds kMasterHasGone{2};
constexpr double kPaceForABusyMaster = 0.1;

}  // namespace

double Machine::now_s() {
  const std::lock_guard lock(mutex_);
  return clock_.now_s() - lost_s_;
}

double Machine::catch_up() {
  const double clock_s = clock_.now_s();
  const double passed_s = clock_s - lost_s_ - now_s_;
  double step_s = passed_s;
  // Only with a node, which looks every few milliseconds: without one nobody need look for long.
  if (node_attached_) step_s = std::min(step_s, kLongestStep_s * clock_.speed());
  const auto silent = std::chrono::steady_clock::now() - drive_.last_request();
  if (clock_.speed() > 1 && silent > kMasterIsBusy && silent < kMasterHasGone) {
    step_s *= kPaceForABusyMaster;
  }
  lost_s_ += passed_s - step_s;
  const double now_s = clock_s - lost_s_;
  now_s_ = now_s;
  while (unit_.next_time_s() <= now_s) {
    const double t_s = unit_.next_time_s();
    drive_.advance(t_s);
    samples_.push_back({unit_.next(drive_.head(t_s)), drive_.moves()});
  }
  drive_.advance(now_s);
  drive_.check_watchdog(now_s, std::chrono::steady_clock::now());
  return now_s;
}

std::vector<TimedSample> Machine::take_samples() {
  const std::lock_guard lock(mutex_);
  catch_up();
  demanded_ = false;
  taken_ += static_cast<std::int64_t>(samples_.size());
  return std::exchange(samples_, {});
}

void Machine::attach_node(bool attached) {
  const std::lock_guard lock(mutex_);
  node_attached_ = attached;
  done_.notify_all();
}

void Machine::sent() {
  const std::lock_guard lock(mutex_);
  sent_ = taken_;
  done_.notify_all();
}

void Machine::wait_until_sent() {
  std::unique_lock lock(mutex_);
  const std::int64_t wanted = taken_ + static_cast<std::int64_t>(samples_.size());
  if (sent_ >= wanted || !node_attached_) return;
  demanded_ = true;
  demand_.notify_all();
  done_.wait_for(lock, kLongestHold, [&] { return sent_ >= wanted || !node_attached_; });
}

void Machine::wait_for_demand(std::chrono::microseconds timeout) {
  std::unique_lock lock(mutex_);
  demand_.wait_for(lock, timeout, [&] { return demanded_; });
}

double Machine::next_sample_s() {
  const std::lock_guard lock(mutex_);
  return unit_.next_time_s();
}

}  // namespace plumbline::sim
