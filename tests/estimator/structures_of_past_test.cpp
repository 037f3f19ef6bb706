// What has no name and comes from the pose before, or the way from there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

using testing::ElementsAre;
using testing::Field;
using testing::SizeIs;

/// What a value was when the head rested at the pose before.
class AtPoseBefore {
 public:
  /// `now`: at time `t_s`.
  double operator()(double now, double t_s) {
    constexpr double kBetweenPoses_s = 1;
    if (t_s > last_s_ + kBetweenPoses_s) before_ = at_;
    at_ = now;
    last_s_ = t_s;
    return before_;
  }

 private:
  double before_ = 0, at_ = 0, last_s_ = 0;
};

// As a settling that takes for ever.
TEST(Structure, WhatAPoseLeavesForGoodIsNoSettling) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 20;
  options.more_V[0] = [before = AtPoseBefore()](const auto& a_g, double t_s) mutable {
    return 1e-3 * (before(a_g[0], t_s) - a_g[0]);
  };
  expect_only_structure(
      options, {"previous_pose", "bias", "polynomial of degree 1 in the change of a_i since"});
}

// The head rests where the run begins, so the first pose was felt before it.
TEST(Structure, WhatTheAxisFeltBeforeMayChangeItsScale) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [before = AtPoseBefore()](const auto& a_g, double t_s) mutable {
    return 1e-3 * before(a_g[0], t_s) * a_g[0];
  };
  expect_only_structure(
      options, {"previous_pose", "scale", "polynomial of degree 1 in the component of a_i before"});
}

// The way of the last turn, kept while only h moves.
TEST(Structure, WhatDependsOnTheDirectionOfTheTurnIsNoPolynomialOfIt) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 20;
  options.more_V[0] = [last_rad = 0.0, way = 1.0](const auto& a_g, double) mutable {
    constexpr double kMoved_rad = 1e-6;
    const double to_rad = std::atan2(-a_g[1], a_g[0]);
    const double delta_rad = to_rad < -kMoved_rad ? to_rad + 2 * std::acos(-1.0) : to_rad;
    if (std::abs(delta_rad - last_rad) > kMoved_rad) way = delta_rad > last_rad ? 1 : -1;
    last_rad = delta_rad;
    return 3e-4 * way;
  };
  expect_only_structure(
      options,
      {"previous_pose", "bias",
       "polynomial of degree 1 in the direction of the last turn of delta within 360 degrees"});
}

// The head came to the first pose from its zero, which nothing recorded says: the first pose tells
// nothing of what depends on the way, and is not blamed.
TEST(Structure, WhatDependsOnTheWaySaysNothingOfTheFirstPose) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 20;
  options.more_V[0] = [before = AtPoseBefore()](const auto& a_g, double t_s) mutable {
    const double h_rad = std::atan2(a_g[2], std::hypot(a_g[0], a_g[1]));
    return 2e-3 * (h_rad - before(h_rad, t_s));
  };
  expect_only_structure(
      options, {"previous_pose", "bias", "polynomial of degree 1 in the change of h since"});
}

/// The way a value moved last: 1 up, −1 down.
class LastWay {
 public:
  double operator()(double now) {
    constexpr double kMoved = 1e-9;
    if (std::abs(now - at_) > kMoved) way_ = now > at_ ? 1 : -1;
    at_ = now;
    return way_;
  }

 private:
  double at_ = 0, way_ = 0;
};

TEST(Structure, APlayThatTheLoadTakesUpTurnsWithTheTilt) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 10;
  options.delta_error_deg = [way = LastWay()](double delta_deg, double h_deg) mutable {
    return 0.5 * way(delta_deg) * std::sin(h_deg * std::numbers::pi / 180);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"previous_pose", "geometry",
                                      "polynomial of degree 1 in the direction of the last turn of "
                                      "delta within 360 degrees, times the sine of h, "
                                      "added to delta"});
  EXPECT_THAT(found.axes, SizeIs(3));
}

// As settling by name, a course over the dwell, and something that came before.
TEST(Structure, WhatRingsAfterEveryMoveIsOneCourse) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.samples_per_pose = 40;
  options.random_order = true;
  options.more_V[0] = [before = AtPoseBefore()](const auto& a_g, double t_s) mutable {
    constexpr double kFirst_s = 61, kPeriod_s = 3, kTau_s = 0.15, kFrequency_hz = 8;
    const double came_from_g = before(a_g[0], t_s);
    if (t_s < kFirst_s) return 0.0;
    const double since_s = std::remainder(t_s - kFirst_s, kPeriod_s);
    return 5e-3 * (came_from_g - a_g[0]) * std::exp(-since_s / kTau_s) *
           std::cos(2 * std::numbers::pi * kFrequency_hz * since_s);
  };
  expect_only_structure(options, {"t_in_pose", "sample",
                                  "ringing that dies away, times the change of a_i on the way"});
}

TEST(Structure, WhatAnotherAxisFeltBeforeIsOneStraightLine) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 20;
  options.more_V[0] = [before = AtPoseBefore()](const auto& a_g, double t_s) mutable {
    return 1e-3 * before(a_g[1], t_s);
  };
  expect_only_structure(
      options, {"previous_pose", "bias",
                "polynomial of degree 1 in the change of the component of the next axis since"});
}

/// What a spring that is drawn against friction holds, 1 at most: in small steps along the way.
class SpringWithFriction {
 public:
  explicit SpringWithFriction(double reach_g) : reach_g_(reach_g) {}
  double operator()(double to_g) {
    if (!at_g_) at_g_ = to_g;
    constexpr int kParts = 2000;
    const double step = (to_g - *at_g_) / (kParts * reach_g_);
    for (int k = 0; k < kParts; ++k) held_ += step * (held_ * step > 0 ? 1 - std::abs(held_) : 1);
    at_g_ = to_g;
    return held_;
  }

 private:
  double reach_g_, held_ = 0;
  std::optional<double> at_g_;
};

// Of small moves in rings the head learns what large ones do: a polynomial of the move would not.
TEST(Structure, WhatIsDrawnAgainstFrictionGoesNoFurtherThanItsReach) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [spring = SpringWithFriction(0.2)](const auto& a_g, double) mutable {
    return 1e-3 * spring(a_g[0]);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"previous_pose", "bias", "friction"});
  ASSERT_EQ(found.parameters.size(), 3U);
  EXPECT_NEAR(found.parameters[0].value, 0.2, 4 * found.parameters[0].u);
  EXPECT_EQ(found.parameters[1].value, 0);
}

// With next to no reach only the side is left.
TEST(Structure, HysteresisOfAnotherAxisIsFrictionInItsComponent) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 20;
  options.more_V[0] = [way = LastWay()](const auto& a_g, double) mutable {
    return 5e-4 * way(a_g[1]);
  };
  expect_only_structure(options,
                        {"previous_pose", "bias", "friction in the component of the next axis"});
}

// A loop that closes at both ends of the range.
TEST(Structure, ALoopLikeALeafIsHysteresisLessWhatTheSquareOfTheForceTakes) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [way = LastWay()](const auto& a_g, double) mutable {
    return 6e-4 * (1 - a_g[0] * a_g[0]) * way(a_g[0]);
  };
  const SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  const Calibration result = calibrated(data);
  EXPECT_THAT(result.diagnosis.effects, ElementsAre(Field(&FoundEffect::id, "sensor.hysteresis")));
  ASSERT_EQ(result.diagnosis.unlisted.size(), 1U);
  EXPECT_EQ(result.diagnosis.unlisted[0].shape,
            "friction, times its own component and its own component");
  EXPECT_LT(result.after.heldout_pose_rms_mps2[0], 1.3 * result.floor_pose_rms_mps2[0]);
}

// As a lag behind a play, a saw tooth of the codes, and noise that wanders.
TEST(Structure, AFlexureThatSnapsIsARelay) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[1] = [seat = 1.0](const auto& a_g, double t_s) mutable {
    if (t_s > 61 && a_g[1] > 0.45) seat = 1;
    if (t_s > 61 && a_g[1] < -0.45) seat = -1;
    return 5e-4 * seat;
  };
  expect_only_structure(options, {"previous_pose", "bias", "relay"});
}

// As the size of the turn, and scales that follow it.
TEST(Structure, WhatTheMotorsWarmOnTheWayGrowsWithItsTime) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  double at_deg = 0, at_h_deg = 0, way_s = 0;
  options.pose_s = [&](double delta_deg, double h_deg) {
    // Whichever axis takes longer; the next pose is not known yet: each waits for the last way.
    const double next_s = 2 + std::max(std::abs(std::remainder(delta_deg - at_deg, 360)) / 40,
                                       std::abs(h_deg - at_h_deg) / 12);
    at_deg = delta_deg;
    at_h_deg = h_deg;
    return next_s;
  };
  options.more_V[0] = [&, last_s = 0.0](const auto&, double t_s) mutable {
    if (t_s > 61 && t_s - last_s > 1) way_s = t_s - last_s;
    last_s = t_s;
    return 1e-4 * way_s;
  };
  expect_only_structure(options,
                        {"previous_pose", "bias", "polynomial of degree 1 in the time on the way"});
}

// As a train of pulses in time.
TEST(Structure, ACableThatFlipsOverIsARelayOfTheTurn) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[0] = [flipped = false](const auto& a_g, double) mutable {
    const double turn = std::atan2(-a_g[1], a_g[0]) / (2 * std::numbers::pi);
    const double delta_deg = 360 * (turn - std::floor(turn));
    if (delta_deg > 245) flipped = true;
    if (delta_deg < 115) flipped = false;
    return flipped ? 3e-4 : 0;
  };
  expect_only_structure(options, {"delta_deg", "bias", "relay in the angle that does not close"});
}

// As waves and bells in time.
TEST(Structure, WhatArrivesLaterGoesByTheValueADeadTimeBefore) {
  constexpr double kDead_s = 30;
  SyntheticOptions options;
  options.delta_step_deg = 10;
  const auto flow = [](double t_s) { return 6 + std::sin(t_s / 25) + 0.7 * std::cos(t_s / 61); };
  options.more_V[1] = [=](const auto&, double t_s) { return 4e-4 * flow(t_s - kDead_s); };
  const UnlistedStructure found =
      expect_only_structure(with_column(options, "flow_lpm", flow),
                            {"flow_lpm", "bias", "straight line in the value a dead time before"});
  EXPECT_NEAR(parameter(found, "tau").value, kDead_s, 1.5);
}

// As a bell in time.
TEST(Structure, WhatACurrentHeatsGoesByThePastOfItsSquare) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  const auto current = [](double t_s) { return 2 * std::sin(t_s / 40) * std::cos(t_s / 170); };
  options.more_V[2] = [heat = 0.0, last_s = 0.0, current](const auto&, double t_s) mutable {
    constexpr double kTau_s = 45;
    const double share = std::exp(-std::max(0.0, t_s - last_s) / kTau_s);
    heat = heat * share + (1 - share) * current(t_s) * current(t_s);
    last_s = t_s;
    return 6e-4 * heat;
  };
  expect_only_structure(
      with_column(options, "motor_A", current),
      {"motor_A", "bias", "straight line in the average of the past of its square"});
}

}  // namespace
}  // namespace plumbline
