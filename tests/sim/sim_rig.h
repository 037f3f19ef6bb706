// What the tests of the simulated unit share: a unit whose numbers are easy to work out by hand.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "rig/sim/unit.h"
#include "rig/sim/world.h"

namespace plumbline::sim {

/// 30 mV/g on every axis, no cross terms, −2.5 V at rest; g_n, no noise, 20 °C, 24 bits over −5…0
/// V.
inline const std::string kPlainWorld = R"(
[unit]
K_x_V_per_g = [0.03, 0, 0]
K_y_V_per_g = [0, 0.03, 0]
K_z_V_per_g = [0, 0, 0.03]
U0_V = [-2.5, -2.5, -2.5]
[adc]
bits = 24
[gravity]
local_mps2 = 9.80665
)";

inline World world_of(const std::string& more) {
  auto world = parse_world(kPlainWorld + more, "test");
  EXPECT_TRUE(world) << (world ? "" : world.error().message);
  return world ? *world : World{};
}

/// A resting head, seen from the node.
inline HeadState resting(double delta_deg, double h_deg) {
  HeadState head;
  head.delta.angle_deg = delta_deg;
  head.h.angle_deg = h_deg;
  head.delta.in_position = head.h.in_position = true;
  return head;
}

/// A unit that goes from pose to pose.
class PlainUnit {
 public:
  explicit PlainUnit(const std::string& more, std::uint64_t seed = 1)
      : unit_(world_of(more), seed) {}

  void go(double t_s, double delta_deg, double h_deg, int approach = 0) {
    unit_.jump_to_pose({t_s, delta_deg, h_deg, approach, pose_++});
    head_ = resting(delta_deg, h_deg);
  }
  /// The output in g after the sample at or after t_s: (U + 2.5 V)/30 mV.
  std::array<double, 3> reading_g(double t_s = 0) {
    do unit_.next(head_);
    while (unit_.next_time_s() <= t_s);
    const auto& u_V = unit_.truth().noiseless_V;
    return {(u_V[0] + 2.5) / 0.03, (u_V[1] + 2.5) / 0.03, (u_V[2] + 2.5) / 0.03};
  }
  const SampleTruth& truth() const { return unit_.truth(); }

 private:
  Unit unit_;
  HeadState head_;
  long long pose_ = 0;
};

inline void expect_g(const std::array<double, 3>& got, const std::array<double, 3>& wanted) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(got[i], wanted[i], 1e-7) << "axis " << i;
}

}  // namespace plumbline::sim
