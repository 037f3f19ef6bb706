// The stream of frames that the node sends, with the faults of the world in it.
#pragma once

#include <linux/can.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "rig/sim/faults.h"
#include "rig/sim/frames.h"
#include "rig/sim/unit.h"

namespace plumbline::sim {

/// What a node sends, faults included, as a stream of frames. No clock and no thread of its own.
class NodeFrames {
 public:
  /// `rate_hz` is the node's sample rate, `bits` the width of its codes; a `serial_number` other
  /// than 0 is sent once a second.
  NodeFrames(double rate_hz, int bits, const Faults& faults, std::uint64_t seed,
             std::uint32_t serial_number = 0);

  /// The frames that go out at this sample, taken after `moves` motions had been started.
  std::vector<can_frame> at(NodeSample sample, std::int64_t moves);

 private:
  void put(std::vector<can_frame>& out, const can_frame& frame, double t_s, std::int64_t moves);

  std::int64_t samples_per_environment_;
  std::int64_t samples_per_identity_;
  std::uint32_t serial_number_;
  std::int32_t largest_code_;
  FaultInjector sample_faults_;
  FaultInjector frame_faults_;
  std::array<std::optional<std::int32_t>, 3> stuck_code_;
  std::optional<can_frame> held_;  ///< to be overtaken by the next frame
};

}  // namespace plumbline::sim
