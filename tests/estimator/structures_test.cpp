// What has no name is told by its driver, what it acts on, and its shape.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

struct Structure {
  const char* driver;
  const char* form;
  const char* shape;
};

UnlistedStructure expect_only_structure(const SyntheticOptions& options,
                                        const Structure& expected) {
  const SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  EXPECT_EQ(result.diagnosis.unlisted.size(), 1U);
  if (result.diagnosis.unlisted.empty()) return {};
  const UnlistedStructure& found = result.diagnosis.unlisted.front();
  EXPECT_EQ(found.driver, expected.driver);
  EXPECT_EQ(found.form, expected.form);
  EXPECT_EQ(found.shape, expected.shape);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    EXPECT_GT(result.floor_pose_rms_mps2[i], 0);
    EXPECT_LT(result.after.heldout_pose_rms_mps2[i], 1.3 * result.floor_pose_rms_mps2[i]);
  }
  return found;
}

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

TEST(Structure, AnAxisThatWasStruckHasAnotherScaleFromThenOn) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto& a_g, double t_s) { return t_s < 150 ? 0 : 1e-3 * a_g[0]; };
  expect_only_structure(options, {"t_s", "scale", "step"});
}

TEST(Structure, AScaleThatWarmsUpDiesAway) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto& a_g, double t_s) {
    return 6e-2 * std::exp(-t_s / 25) * a_g[0];
  };
  expect_only_structure(options, {"t_s", "scale", "exponential"});
}

TEST(Structure, ABaseThatWasPushedStandsCrookedFromThenOn) {
  SyntheticOptions options;
  options.base_roll_rad = [](double t_s) { return t_s < 150 ? 0 : 0.02; };
  expect_only_structure(options, {"t_s", "geometry", "step, added to the base roll"});
}

// As a warm-up and a polynomial it ended with the run.
TEST(Structure, WhatDiffusesGrowsWithTheRootOfTheTime) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto&, double t_s) {
    return t_s < 61 ? 0 : 5e-4 * std::sqrt(t_s - 61);
  };
  expect_only_structure(options, {"t_s", "bias", "power"});
}

// As a cubic it left remnants that other effects were named for.
TEST(Structure, AnEndThatIsReachedGraduallyIsAWideStep) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) { return 1e-3 * std::tanh(a_g[0] / 0.15); };
  expect_only_structure(options, {"a_x", "bias", "step"});
}

TEST(Structure, ProductsOfThreeComponentsAreNotDrivenByTheTime) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto& a_g, double) { return 3e-3 * a_g[0] * a_g[1] * a_g[2]; };
  expect_only_structure(options,
                        {"a_x", "scale",
                         "polynomial of degree 1, times the component of the next axis and "
                         "the component of the axis after the next"});
}

// As series of lower order, steps and waves it left remnants, each with a finding of its own.
TEST(Structure, AHighHarmonicOfTheSpindleIsOne) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    return 3e-4 * std::sin(7 * std::atan2(-a_g[1], a_g[0]) + 0.4);
  };
  expect_only_structure(options, {"delta_deg", "bias", "harmonic"});
}

// As three listed effects that cancelled.
TEST(Structure, AResonanceAtOneValueOfAComponentIsABell) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    return 1e-3 * std::exp(-0.5 * std::pow((a_g[0] - 0.35) / 0.06, 2));
  };
  expect_only_structure(options, {"a_x", "bias", "bell"});
}

TEST(Structure, AGainThatFallsBeyondTheSameSizeOnBothSidesIsOneBend) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    const double beyond_g = std::max(0.0, std::abs(a_g[0]) - 0.6);
    return 3e-3 * std::copysign(beyond_g, a_g[0]);
  };
  expect_only_structure(options, {"a_x", "bias", "bend"});
}

// By the time, which rises with h.
TEST(Structure, AProductOfThirdOrderIsThatAndNoBendInTime) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) { return 2e-3 * a_g[0] * a_g[2] * a_g[2]; };
  expect_only_structure(options, {"a_z", "scale", "square"});
}

TEST(Structure, WhatFallsBackAgainAndAgainIsASawTooth) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto&, double t_s) {
    const double cycles = t_s / 97;
    return 5e-4 * (cycles - std::floor(cycles) - 0.5);
  };
  expect_only_structure(options, {"t_s", "bias", "saw tooth"});
}

TEST(Structure, AWheelThatIsOffOverPartOfATurnIsASector) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double) {
    return delta_deg > 204 && delta_deg < 276 ? 1.0 : 0.0;
  };
  expect_only_structure(options, {"delta_deg", "geometry", "sector, added to delta"});
}

// As a bell too narrow for anything to tell its width from its height; their variances came out
// negative.
TEST(Structure, ADamagedDivisionIsOnePosition) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double) { return delta_deg == 120 ? 1.5 : 0.0; };
  const UnlistedStructure found =
      expect_only_structure(options, {"delta_deg", "geometry", "one position, added to delta"});
  ASSERT_EQ(found.parameters.size(), 3U);
  EXPECT_NEAR(found.parameters[0].value, 120 * std::numbers::pi / 180, 1e-9);
  EXPECT_NEAR(found.parameters[2].value, 1.5, 3 * found.parameters[2].u);
  EXPECT_GT(found.parameters[2].u, 0);
}

// As a bell that reaches the rings beside it, and a step of the tilt where the head went there.
TEST(Structure, ADamagedTiltIsOnePosition) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.h_error_deg = [](double, double h_deg) { return h_deg == 40 ? 2.0 : 0.0; };
  expect_only_structure(options, {"h_deg", "geometry", "one position, added to h"});
}

// As one bias for each harmonic and axis. Every second position is off the other way.
TEST(Structure, TheLastHarmonicThatThePositionsShowIsAnAngle) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double) {
    return 0.5 * std::cos(18 * delta_deg * std::acos(-1.0) / 180);
  };
  expect_only_structure(options, {"delta_deg", "geometry", "harmonic, added to delta"});
}

// As three periodic errors of the drive, by name.
TEST(Structure, AWheelWithThreeArmsHasOneErrorThreeTimes) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double) {
    return 6 * std::abs(std::remainder(delta_deg - 17, 120) / 60);
  };
  expect_only_structure(
      options, {"delta_deg", "geometry", "harmonics of a part of the turn, added to delta"});
}

TEST(Structure, AWobbleThatGrowsWithTheWeightIsOneHarmonic) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_error_deg = [](double delta_deg, double h_deg) {
    const double degree = std::acos(-1.0) / 180;
    return 0.6 * std::cos(4 * delta_deg * degree) * std::cos(h_deg * degree);
  };
  expect_only_structure(options,
                        {"delta_deg", "geometry", "harmonic, times the cosine of h, added to h"});
}

// Where one ring is visited after the other at an even pace, a wave in the time is one in δ as
// well, on these poses and on no others.
TEST(Structure, ARollThatFollowsTheTurnIsNoWaveInTime) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.roll_error_deg = [](double delta_deg, double) {
    return 0.4 * std::cos(2 * delta_deg * std::acos(-1.0) / 180 + 1);
  };
  expect_only_structure(options, {"delta_deg", "geometry", "harmonic, added to the base roll"});
}

// As a scale of h by name, and a function of h added to delta.
TEST(Structure, AFrameThatBendsSidewaysRollsWithTheTilt) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.roll_error_deg = [](double, double h_deg) {
    return 2 * std::cos(3 * h_deg * std::acos(-1.0) / 180);
  };
  expect_only_structure(options, {"h_deg", "geometry", "wave, added to the base roll"});
}

// Between two rings h rises and time passes: the time would have to jump just there.
TEST(Structure, ATiltThatJumpsBetweenTwoRingsJumpsInH) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.h_error_deg = [](double, double h_deg) { return h_deg > 45 ? 0.7 : 0.0; };
  expect_only_structure(options, {"h_deg", "geometry", "step, added to h"});
}

// Where its edge lies between two readings nothing tells how wide it is: uncertainties that were
// those of the last trial before left an expected residual of zero.
TEST(Structure, ATiltThatJumpsAtSomeInstantJumpsInTime) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  for (const double at_s : {300.0, 410.0}) {
    SCOPED_TRACE(at_s);
    options.base_roll_rad = [=](double t_s) { return t_s > at_s ? 0.03 : 0.0; };
    expect_only_structure(options, {"t_s", "geometry", "step, added to the base roll"});
  }
}

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

// A force that one ring feels: the time would have to jump just between two rings. Which of both it
// was, these poses do not tell, and it is said.
TEST(Structure, ABiasThatJumpsBetweenTwoRingsFollowsTheComponent) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) { return a_g[2] > 0.7 ? 8e-4 : 0.0; };
  const UnlistedStructure found = expect_only_structure(options, {"a_z", "bias", "step"});
  EXPECT_THAT(found.alternatives, Contains("sensor.bias_step"));
  EXPECT_NE(found.separate_by, "");
}

// A temperature that rises steadily is another clock: which of the two the bias follows, only a run
// in which it does something else can tell.
TEST(Structure, WhatFollowsATemperatureThatRisesSteadilyCouldFollowTheTime) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto&, double t_s) { return 6e-8 * std::pow(t_s - 150, 2); };
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  for (const double t_s : data.run.samples.t_s) data.run.samples.temp_C.push_back(20 + 0.01 * t_s);
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(1));
  const UnlistedStructure& found = result.diagnosis.unlisted.front();
  ASSERT_THAT(found.driver, AnyOf("t_s", "temp_C"));
  const char* other = found.driver == "t_s" ? "unlisted:temp_C:bias" : "unlisted:t_s:bias";
  EXPECT_THAT(found.alternatives, Contains(other));
  EXPECT_THAT(found.separate_by, HasSubstr(other));
}

// As a coefficient of temperature by name, and a lag behind the temperature.
TEST(Structure, WhatATemperatureDrawsThroughAPlayIsOneFunctionOfIt) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  const auto temperature_C = [](double t_s) { return 21 + 3 * std::sin(t_s / 60); };
  options.more_V[0] = [temperature_C, drawn_C = temperature_C(0)](const auto&, double t_s) mutable {
    constexpr double kHalfPlay_C = 1;
    drawn_C =
        std::clamp(drawn_C, temperature_C(t_s) - kHalfPlay_C, temperature_C(t_s) + kHalfPlay_C);
    return 1e-3 * drawn_C;
  };
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  for (const double t_s : data.run.samples.t_s)
    data.run.samples.temp_C.push_back(temperature_C(t_s));
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(1));
  const UnlistedStructure& found = result.diagnosis.unlisted.front();
  EXPECT_EQ(found.driver, "temp_C");
  EXPECT_EQ(found.form, "bias");
  EXPECT_EQ(found.shape, "drawn through a play");
  EXPECT_NEAR(found.parameters[0].value, 2, 3 * found.parameters[0].u);
}

// As a step of the bias in time and another structure beside it.
TEST(Structure, ABellOverTwoRingsIsOne) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    return 1e-3 * std::exp(-0.5 * std::pow((a_g[2] - 0.42) / 0.1, 2));
  };
  expect_only_structure(options, {"a_z", "bias", "bell"});
}

// As two steps that cancel.
TEST(Structure, ABiasThatIsThereForAWhileIsAWindow) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto&, double t_s) { return t_s > 200 && t_s < 290 ? 6e-4 : 0.0; };
  expect_only_structure(options, {"t_s", "bias", "window"});
}

// As steps of the bias, of which the last stayed.
TEST(Structure, AShockThatDiesAwayIsOneJump) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto&, double t_s) {
    return t_s < 231 ? 0.0 : 1e-3 * std::exp((231 - t_s) / 80);
  };
  expect_only_structure(options, {"t_s", "bias", "jump that dies away"});
}

// One visit on the wrong side of a fall this large hides that all others are right.
TEST(Structure, ALargeSawToothIsNoDriftWithSteps) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.more_V[1] = [](const auto&, double t_s) {
    const double teeth = (t_s + 31) / 222;
    return 1e-2 * (teeth - std::floor(teeth));
  };
  expect_only_structure(options, {"t_s", "bias", "saw tooth"});
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

TEST(Structure, ACrossSensitivityThatJumpsIsAScale) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double t_s) { return t_s > 280 ? 2e-3 * a_g[1] : 0.0; };
  expect_only_structure(options, {"t_s", "scale", "step, times the component of the next axis"});
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

}  // namespace
}  // namespace plumbline
