// The simulated accelerometer node: takes the machine's samples and sends them as CAN frames.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "rig/sim/frame_output.h"
#include "rig/sim/machine.h"
#include "rig/sim/node_frames.h"

namespace plumbline::sim {

/// Sends at the pace of the world clock, on a thread of its own, until destroyed. When it is late
/// it catches up in a burst: no sample is left out. `machine` must live longer.
class CanNode {
 public:
  CanNode(Machine& machine, std::unique_ptr<FrameOutput> output, NodeFrames frames);
  ~CanNode();
  CanNode(const CanNode&) = delete;
  CanNode& operator=(const CanNode&) = delete;

  const std::string& endpoint() const { return output_->endpoint(); }
  /// Why sending has ended, if it has. Thread safe.
  std::optional<Error> failure() const;

 private:
  void run(const std::stop_token& stop);
  Result<void> send_due();

  Machine& machine_;
  std::unique_ptr<FrameOutput> output_;
  NodeFrames frames_;
  mutable std::mutex mutex_;
  std::optional<Error> failure_;
  std::jthread thread_;
};

}  // namespace plumbline::sim
