// The simulated unit in its room: from the head's motion to the codes that the node sends.
// Physics of its own; nothing of estimator/ but the plain vocabulary is used here.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

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

/// What really was at the instant of a sample; for tests and for studies with known truth.
struct SampleTruth {
  double delta_deg = 0;  ///< angles of the drives, without the errors of the head
  double h_deg = 0;
  std::array<double, 3> a_g{};          ///< specific force in the sensor frame
  std::array<double, 3> noiseless_V{};  ///< output, effects included
  std::array<std::int32_t, 3> code{};   ///< as sent
  std::array<std::int32_t, 3>
      plain_code{};   ///< same unit, head and noise without any of [[effects]]
  double temp_C = 0;  ///< of the sensor
  long long pose = 0;
};

/// The head stands at another pose; what lay between is not looked at.
struct Arrival {
  double t_s = 0;
  double delta_deg = 0;
  double h_deg = 0;
  int approach = 0;    ///< direction of the last δ motion: −1, +1, or 0 when only h has moved
  long long pose = 0;  ///< its number from now on
};

/// Produces one sample after another at the node's rate. Everything random comes from the seed
/// alone, each source from a stream of its own: the same motion gives the same codes.
class Unit {
 public:
  Unit(const World& world, std::uint64_t seed);
  ~Unit();
  Unit(Unit&&) noexcept;
  Unit& operator=(Unit&&) noexcept;
  /// The sample with the next counter; `head` is the head at next_time_s().
  NodeSample next(const HeadState& head);
  double next_time_s() const;

  /// For recording without wires: leaves samples out until the clock is at or past the arrival.
  /// Noise, room and effects live through the gap, which counts as motion.
  void jump_to_pose(const Arrival& arrival);
  /// Of the sample returned last.
  const SampleTruth& truth() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline::sim
