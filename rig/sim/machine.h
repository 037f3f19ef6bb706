// The drive, the head and the unit on one clock, shared by the Modbus and the CAN side.
#pragma once

#include <chrono>
#include <condition_variable>
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

  double speed() const { return clock_.speed(); }
  /// World time. It falls behind the clock when this machine is too busy to keep up, or (above 1×)
  /// the drive's master is: the world then runs slower for everybody, instead of leaping under the
  /// feet of whoever looks at it.
  double now_s();

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

  // The node's frames are on its bus within a moment of the sample, and a reply of the drive does
  // not overtake them however busy this machine is: whoever replies waits until the node has sent
  // what has been taken so far.

  /// A node that will call sent() has been attached (or detached).
  void attach_node(bool attached);
  /// The samples of the last take_samples() have been sent.
  void sent();
  /// Until everything taken so far has been sent, however long the node needs for it; only a node
  /// that hangs is given up.
  void wait_until_sent();
  /// For the node: until somebody waits in wait_until_sent(), or `timeout` has passed.
  void wait_for_demand(std::chrono::microseconds timeout);

 private:
  double catch_up();

  std::mutex mutex_;
  WorldClock clock_;
  double now_s_ = 0;   ///< world time of the last catch_up()
  double lost_s_ = 0;  ///< how far it is behind the clock for good
  Drive drive_;
  Unit unit_;
  std::vector<TimedSample> samples_;
  bool node_attached_ = false;
  bool demanded_ = false;
  std::int64_t taken_ = 0;  ///< samples handed out by take_samples()
  std::int64_t sent_ = 0;   ///< of those, sent
  std::condition_variable demand_;
  std::condition_variable done_;
};

}  // namespace plumbline::sim
