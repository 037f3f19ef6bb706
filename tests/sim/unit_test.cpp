// The simulated unit: converter, temperature, recognition of poses, repeatability.
#include "rig/sim/unit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "rig/sim/pose_tracker.h"
#include "tests/sim/sim_rig.h"

namespace plumbline::sim {
namespace {

NodeSample sample_at(int bits, double u_V) {
  World world = world_of("");
  world.adc.bits = bits;
  world.triad.U0_V = {u_V - 0.03, -2.5, -2.5};
  Unit unit(world, 1);
  return unit.next(resting(0, 0));  // a = (1, 0, 0)
}

TEST(Unit, CodesOfEveryWidthAtTheEdgesOfTheSpan) {
  for (const int bits : {12, 16, 24}) {
    const auto half = std::int32_t{1} << (bits - 1);
    const double lsb_V = 5.0 / (2.0 * half);
    EXPECT_EQ(sample_at(bits, -2.5).code[0], 0) << bits;
    EXPECT_EQ(sample_at(bits, -2.5 + 0.6 * lsb_V).code[0], 1) << bits;
    EXPECT_EQ(sample_at(bits, -2.5 - 0.6 * lsb_V).code[0], -1) << bits;
    EXPECT_EQ(sample_at(bits, -5.0).code[0], -half) << bits;
    EXPECT_EQ(sample_at(bits, -7.0).code[0], -half) << bits;
    EXPECT_EQ(sample_at(bits, 1.0).code[0], half - 1) << bits;
    EXPECT_FALSE(sample_at(bits, -4.99).clipped);
    EXPECT_TRUE(sample_at(bits, -7.0).clipped);
    EXPECT_TRUE(sample_at(bits, 1.0).clipped);
  }
}

TEST(Unit, LocalGravityScalesTheForce) {
  World world = world_of("");
  world.gravity.local_mps2 = 9.80665 * 1.01;
  Unit unit(world, 1);
  unit.next(resting(0, 0));
  EXPECT_NEAR(unit.truth().noiseless_V[0], -2.5 + 0.0303, 1e-12);
}

TEST(Unit, SamplesComeAtTheRateAndCountUp) {
  Unit unit(world_of("[node]\nrate_hz = 50"), 1);
  for (std::int64_t n = 0; n < 5; ++n) {
    EXPECT_DOUBLE_EQ(unit.next_time_s(), 0.02 * static_cast<double>(n));
    EXPECT_EQ(unit.next(resting(0, 0)).counter, n);
  }
}

TEST(Unit, SensorFollowsTheRoomWithItsLag) {
  // Ramp of 3.6 K/h = 1 mK/s: behind a lag of 100 s the sensor ends 0.1 K late.
  PlainUnit unit("[node]\nrate_hz = 10\n[room]\ndrift_C_per_h = 3.6\nsensor_lag_s = 100");
  unit.go(0, 0, 0);
  unit.reading_g(2000);
  EXPECT_NEAR(unit.truth().temp_C, 22 + 2 - 0.1, 2e-3);
}

TEST(Unit, PositioningErrorIsDrawnOnceAPose) {
  PlainUnit unit("[head]\nscatter_delta_arcsec = 360\n");
  unit.go(0, 90, 0);
  const auto first = unit.reading_g(0);
  const auto same = unit.reading_g(0.5);
  EXPECT_EQ(first, same);
  EXPECT_NE(first[0], 0);
  EXPECT_LT(std::abs(first[0]), 0.01);  // 360″ = 1.7 mrad
  unit.go(5, 90, 0);
  EXPECT_NE(unit.reading_g()[0], first[0]);
}

TEST(Unit, SameSeedSameCodesOtherSeedOtherCodes) {
  const World world = world_of("[noise]\nN = 1e-5\nB = 1e-5\nK = 1e-6\nR = 1e-7\nQ = 1e-7");
  const auto codes = [&](std::uint64_t seed) {
    Unit unit(world, seed);
    std::vector<std::int32_t> all;
    for (int i = 0; i < 100; ++i) {
      for (const auto code : unit.next(resting(10, 20)).code) all.push_back(code);
    }
    return all;
  };
  EXPECT_EQ(codes(7), codes(7));
  EXPECT_NE(codes(7), codes(8));
}

TEST(Unit, DrawnUnitsDifferBySeedWithinTheirSpread) {
  const World world = world_of("[noise]\n");
  World random = world;
  random.scatter = {.random = true, .scale_rel = 0.02, .cross_V_per_g = 3e-4, .bias_V = 0.03};
  EXPECT_EQ(draw_triad(world, 5).U0_V, world.triad.U0_V);
  EXPECT_EQ(draw_triad(random, 5).U0_V, draw_triad(random, 5).U0_V);
  double sum = 0;
  constexpr int kUnits = 2000;
  for (std::uint64_t seed = 0; seed < kUnits; ++seed) {
    const double k = draw_triad(random, seed).K_V_per_g[0][0] / 0.03 - 1;
    sum += k * k;
  }
  EXPECT_NEAR(std::sqrt(sum / kUnits), 0.02, 0.02 * 5 / std::sqrt(2.0 * kUnits));
}

// --- poses in the motion of a head ---------------------------------------------------------------

/// Feeds a tracker with rests and moves at 100 Hz.
class Motion {
 public:
  void rest(double seconds) {
    for (; seconds > 0; seconds -= 0.01) step(false);
  }
  void move(double delta_deg, double h_deg) {
    for (int i = 0; i < 50; ++i) {
      delta_ += delta_deg / 50;
      h_ += h_deg / 50;
      step(true);
    }
  }
  PoseTracker tracker;

 private:
  void step(bool moving) {
    HeadState head = resting(delta_, h_);
    head.delta.moving = moving;
    head.delta.in_position = !moving;
    tracker.observe(t_s_, head);
    t_s_ += 0.01;
  }
  double t_s_ = 0, delta_ = 0, h_ = 0;
};

TEST(PoseTracker, CountsRestsAndRemembersTheApproach) {
  Motion head;
  head.rest(1);
  EXPECT_EQ(head.tracker.pose(), 0);
  EXPECT_EQ(head.tracker.approach(), 0);
  head.move(10, 0);
  head.rest(1);
  EXPECT_EQ(head.tracker.pose(), 1);
  EXPECT_EQ(head.tracker.approach(), 1);
  EXPECT_NEAR(head.tracker.arrival_s(), 1.5, 0.011);
  head.move(-4, 5);
  head.rest(1);
  EXPECT_EQ(head.tracker.approach(), -1);
  head.move(0, 5);
  head.rest(1);
  EXPECT_EQ(head.tracker.pose(), 3);
  EXPECT_EQ(head.tracker.approach(), -1) << "a move of h alone leaves the play of δ as it was";
}

TEST(PoseTracker, AStopOnTheWayIsNoPoseButDecidesTheApproach) {
  Motion head;
  head.rest(1);
  head.move(10, 0);
  head.rest(1);
  head.move(-7, 0);  // passes 3°, one-sided approach of 5°
  head.rest(0.1);
  head.move(2, 0);
  head.rest(1);
  EXPECT_EQ(head.tracker.pose(), 2);
  EXPECT_EQ(head.tracker.approach(), 1);
}

}  // namespace
}  // namespace plumbline::sim
