// The drive, the head and the unit on one clock, shared by the Modbus and the CAN side.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <utility>
#include <vector>

#include "rig/sim/drive.h"
#include "rig/sim/unit.h"

namespace plumbline::sim {

/// World time: `speed` times the host's monotonic time since the start.
class WorldClock {
 public:
  explicit WorldClock(double speed) : speed_(speed), start_(std::chrono::steady_clock::now()) {}
  double now_s() const {
    const std::chrono::duration<double> host = std::chrono::steady_clock::now() - start_;
    return host.count() * speed_;
  }
  double speed() const { return speed_; }

 private:
  double speed_;
  std::chrono::steady_clock::time_point start_;
};

/// A sample, and how many motions of the head had been started when it was taken.
struct TimedSample {
  NodeSample sample;
  std::int64_t moves = 0;
};

/// Whoever touches the machine first brings it up to the present: every sample that is due is taken
/// at exactly its own time, before a command that came after it can move the head. So the samples
/// do not depend on which thread runs when. Thread safe.
class Machine {
 public:
  Machine(Drive drive, Unit unit, double speed)
      : clock_(speed), drive_(std::move(drive)), unit_(std::move(unit)) {}

  const WorldClock& clock() const { return clock_; }

  /// Runs `use(drive, t_s)` on the drive at the present world time t_s.
  template <class Use>
  auto with_drive(Use&& use) {
    const std::lock_guard lock(mutex_);
    const double now_s = catch_up();
    return std::forward<Use>(use)(drive_, now_s);
  }

  /// The samples taken since the last call, in order.
  std::vector<TimedSample> take_samples();
  /// World time of the next sample.
  double next_sample_s();

 private:
  double catch_up();

  std::mutex mutex_;
  WorldClock clock_;
  Drive drive_;
  Unit unit_;
  std::vector<TimedSample> samples_;
};

}  // namespace plumbline::sim
