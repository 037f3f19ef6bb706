// The simulated unit in its room: from the head's motion to the codes that the node sends.
// Physics of its own; nothing of estimator/ but the plain vocabulary is used here.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "rig/sim/axis.h"

namespace plumbline::sim {

struct World;

/// State of both axes at the instant of a sample.
struct HeadState {
  AxisState delta;
  AxisState h;
};

/// One sample of the node and the slow quantities recorded beside it.
struct NodeSample {
  std::int64_t counter = 0;
  double t_s = 0;                      ///< world time = node sample clock
  std::array<std::int32_t, 3> code{};  ///< sign-extended
  double temp_C = 0;                   ///< of the node's own thermometer
  bool clipped = false;
  double rh_pct = 0;  ///< room humidity
  double supply_V = 0;
  double motor_A = 0;
};

/// Produces one sample after another at the node's rate. Everything random comes from the seed and
/// the sample counter alone, so the same motion gives the same codes.
class Unit {
 public:
  Unit(const World& world, std::uint64_t seed);
  ~Unit();
  Unit(Unit&&) noexcept;
  /// The sample with the next counter; `head` is the head at next_time_s().
  NodeSample next(const HeadState& head);
  double next_time_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline::sim
