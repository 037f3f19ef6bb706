// The motion of one simulated axis against closed forms worked out by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "rig/sim/axis.h"

namespace plumbline::sim {
namespace {

AxisDynamics plain() {
  AxisDynamics dynamics;
  dynamics.power_on_deg = 0;
  return dynamics;
}

double largest_encoder(const Axis& axis, double from_s, double to_s) {
  double largest = -1e9;
  for (double t = from_s; t < to_s; t += 1e-4) {
    largest = std::max(largest, axis.at(t).encoder_deg);
  }
  return largest;
}

// A triangle: peak speed sqrt(10·60) = 24.495 °/s, duration 2·24.495/60 = 0.8165 s.
TEST(WireAxis, ShortMoveIsATriangle) {
  Axis axis(plain());
  axis.start_move(2.0, 10.0, 0, 0, 0);
  EXPECT_NEAR(axis.end_s(), 2.0 + 2 * std::sqrt(600.0) / 60, 1e-9);
  const double middle_s = 2.0 + std::sqrt(600.0) / 60;
  EXPECT_NEAR(axis.at(middle_s).speed_deg_s, std::sqrt(600.0), 1e-6);
  EXPECT_NEAR(axis.at(middle_s).angle_deg, 5.0, 1e-9);
}

// Ramps of 0.5 s and 7.5° each, 75° at 30 °/s between: 0.5 + 2.5 + 0.5 = 3.5 s.
TEST(WireAxis, LongMoveIsATrapezoid) {
  Axis axis(plain());
  axis.start_move(0.0, -90.0, 30, 60, 60);
  EXPECT_NEAR(axis.end_s(), 3.5, 1e-9);
  EXPECT_NEAR(axis.at(0.25).angle_deg, -1.875, 1e-9);
  EXPECT_NEAR(axis.at(0.5).angle_deg, -7.5, 1e-9);
  EXPECT_NEAR(axis.at(1.75).angle_deg, -45.0, 1e-9);
  EXPECT_DOUBLE_EQ(axis.at(1.75).speed_deg_s, -30.0);
  EXPECT_NEAR(axis.at(3.25).angle_deg, -88.125, 1e-9);
  EXPECT_TRUE(axis.at(3.499).moving);
  EXPECT_FALSE(axis.at(3.501).moving);
}

// Speed 20, acceleration 40 (5° in 0.5 s), deceleration 10 (20° in 2 s), 35° between in 1.75 s.
TEST(WireAxis, CommandMayAskForLessThanTheLargest) {
  Axis axis(plain());
  axis.start_move(0.0, 60.0, 20, 40, 10);
  EXPECT_NEAR(axis.end_s(), 4.25, 1e-9);
  EXPECT_NEAR(axis.at(2.25).angle_deg, 40.0, 1e-9);
  axis.start_move(10.0, 0.0, 500, 500, 500);  // more than there is: 30 °/s, 60 °/s²
  EXPECT_NEAR(axis.end_s(), 10 + 2.5, 1e-9);
}

TEST(WireAxis, OvershootsByTheStatedPeakAndSettles) {
  Axis axis(plain());
  axis.start_move(0.0, 90.0, 0, 0, 0);
  EXPECT_NEAR(largest_encoder(axis, 3.4, 5.0), 90.02, 1.0 / 3600);
  // Amplitude 0.02/(e^(−p/ωτ)·sin p), p = atan(ωτ) = 1.40644: 0.025597°, at 0.005° after
  // 0.12·ln(5.1194) = 0.19598 s, held for 0.05 s.
  EXPECT_FALSE(axis.at(3.7459).in_position);
  EXPECT_TRUE(axis.at(3.7461).in_position);
  for (double t = 3.5 + 0.196; t < 5; t += 1e-3) {
    EXPECT_NEAR(axis.at(t).angle_deg, 90.0, 0.005) << "at " << t << " s";
  }
}

TEST(WireAxis, SmallCorrectionRingsLittle) {
  Axis axis(plain());
  axis.start_move(0.0, 0.05, 0, 0, 0);
  EXPECT_NEAR(largest_encoder(axis, 0.0, 1.0), 0.055, 1.0 / 3600);
}

TEST(WireAxis, EncoderIsRoundedTheShaftIsNot) {
  Axis axis(plain());
  axis.start_move(0.0, 90.0, 0, 0, 0);
  const AxisState state = axis.at(1.2345678);
  const double steps = state.encoder_deg * 3600;
  EXPECT_NEAR(steps, std::round(steps), 1e-6);
  EXPECT_GT(std::abs(state.angle_deg * 3600 - steps), 1e-3);
  EXPECT_LE(std::abs(state.angle_deg - state.encoder_deg), 0.5 / 3600 + 1e-12);
}

// At 30 °/s: 0.5 s and 7.5° to rest.
TEST(WireAxis, StopBrakesAndIsNotInPosition) {
  Axis axis(plain());
  axis.start_move(0.0, 90.0, 0, 0, 0);
  axis.stop(1.0);  // at 22.5°
  EXPECT_NEAR(axis.end_s(), 1.5, 1e-9);
  EXPECT_NEAR(axis.at(10).angle_deg, 30.0, 1e-6);
  EXPECT_FALSE(axis.at(10).moving);
  EXPECT_FALSE(axis.at(10).in_position);
}

// Sent back while going at 30 °/s at 22.5°: rest at 30° after 0.5 s, then 30° in 1.5 s.
TEST(WireAxis, RetargetingBrakesFirst) {
  Axis axis(plain());
  axis.start_move(0.0, 90.0, 0, 0, 0);
  axis.start_move(1.0, 0.0, 0, 0, 0);
  EXPECT_NEAR(axis.at(1.0).speed_deg_s, 30.0, 1e-9);
  EXPECT_NEAR(axis.at(1.5).angle_deg, 30.0, 1e-9);
  EXPECT_NEAR(axis.end_s(), 3.0, 1e-9);
  EXPECT_NEAR(axis.at(9).angle_deg, 0.0, 1e-6);
  EXPECT_TRUE(axis.at(9).in_position);
}

TEST(WireAxis, BlockedShaftStaysWhileTheProfileGoesOn) {
  Axis axis(plain());
  axis.start_move(0.0, 90.0, 0, 0, 0);
  axis.block(1.0);
  EXPECT_NEAR(axis.at(2.0).encoder_deg, 22.5, 1.0 / 3600);
  EXPECT_NEAR(axis.at(2.0).commanded_deg, 52.5, 1e-9);
  EXPECT_FALSE(axis.at(10).in_position);
  axis.freeze(2.0);
  EXPECT_NEAR(axis.at(3.0).commanded_deg, 22.5, 1e-9);
  EXPECT_FALSE(axis.at(3.0).moving);
}

TEST(WireAxis, SlipIsSeenByTheShaftOnlyAndHomingTakesItOut) {
  AxisDynamics dynamics = plain();
  dynamics.power_on_deg = 3;
  dynamics.home_offset_deg = 0.01;
  Axis axis(dynamics);
  EXPECT_DOUBLE_EQ(axis.at(0).encoder_deg, 0.0);
  EXPECT_DOUBLE_EQ(axis.at(0).angle_deg, 3.0);
  axis.slip(0.25);
  EXPECT_DOUBLE_EQ(axis.at(0).encoder_deg, 0.0);
  EXPECT_DOUBLE_EQ(axis.at(0).angle_deg, 2.75);
  EXPECT_DOUBLE_EQ(axis.home_switch_encoder_deg(), -7.75);
  axis.start_move(1.0, axis.home_switch_encoder_deg(), 10, 0, 0);
  axis.reference(5.0);
  EXPECT_NEAR(axis.at(5.0).angle_deg, -5.0, 1e-9);
  EXPECT_NEAR(axis.at(5.0).encoder_deg, -5.01, 0.5 / 3600);
  axis.start_move(5.0, 0.0, 0, 0, 0);
  EXPECT_NEAR(axis.at(9.0).angle_deg, 0.01, 1e-9);
}

}  // namespace
}  // namespace plumbline::sim
