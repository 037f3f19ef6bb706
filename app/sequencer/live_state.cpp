#include "app/sequencer/live_state.h"

#include <algorithm>
#include <utility>

#include "app/sequencer/progress.h"

namespace plumbline::app {

namespace {

constexpr std::chrono::milliseconds kSampleInterval{20};

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

LiveState::LiveState(LiveRun run) : run_(std::move(run)) {}

void LiveState::update(const Progress& progress) {
  const Clock::time_point now = Clock::now();
  const std::lock_guard lock(mutex_);
  if (progress.state != progress_.state) {
    state_since_ = now;
    ++version_;
  }
  if (progress.events != progress_.events) {
    events_.push_back(progress.last_event);
    if (events_.size() > kRecentEvents) events_.pop_front();
    ++version_;
  }
  const bool new_pose = progress.last_pose && (!progress_.last_pose ||
                                               progress.last_pose->t_s != progress_.last_pose->t_s);
  if (new_pose) {
    poses_.push_back(*progress.last_pose);
    ++version_;
  }
  if (progress.newest && now >= next_sample_) {
    next_sample_ = now + kSampleInterval;
    samples_.push_back(*progress.newest);
    if (samples_.size() > kRecentSamples) samples_.pop_front();
  }
  // The pace counts from the first pose of this session on: homing and resuming are no part of it.
  if (!pace_started_ && progress.state == EngineState::moving) {
    pace_started_ = true;
    pace_start_ = now;
    planned_before_s_ = progress.planned_done_s;
  }
  progress_ = progress;
}

LiveSnapshot LiveState::snapshot() const {
  const Clock::time_point now = Clock::now();
  const std::lock_guard lock(mutex_);
  LiveSnapshot snapshot;
  snapshot.run = run_;
  snapshot.progress = progress_;
  snapshot.elapsed_s = seconds(now - start_);
  snapshot.state_since_s = seconds(now - state_since_);
  const double done_s = progress_.planned_done_s - planned_before_s_;
  const double left_s = std::max(0.0, progress_.planned_total_s - progress_.planned_done_s);
  if (pace_started_ && progress_.planned_total_s > 0 &&
      done_s > kPaceKnown * progress_.planned_total_s) {
    snapshot.remaining_s = seconds(now - pace_start_) / done_s * left_s;
  }
  snapshot.poses = poses_.size();
  snapshot.samples.assign(samples_.begin(), samples_.end());
  snapshot.events.assign(events_.begin(), events_.end());
  return snapshot;
}

std::vector<PoseMean> LiveState::poses(std::size_t first, std::size_t most) const {
  const std::lock_guard lock(mutex_);
  const std::size_t begin = std::min(first, poses_.size());
  const std::size_t count = std::min(most, poses_.size() - begin);
  const auto from = poses_.begin() + static_cast<std::ptrdiff_t>(begin);
  return {from, from + static_cast<std::ptrdiff_t>(count)};
}

std::uint64_t LiveState::version() const {
  const std::lock_guard lock(mutex_);
  return version_;
}

}  // namespace plumbline::app
