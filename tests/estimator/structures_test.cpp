// What has no name is told by its driver, what it acts on, and its shape.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

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

// The first poses tell when it began: a warm-up would make up for what they have come by then.
TEST(Structure, WhatDiffusesMayHaveBegunWithTheClock) {
  SyntheticOptions options;
  options.still_s = 4;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[2] = [](const auto&, double t_s) { return 5e-4 * std::sqrt(t_s); };
  const UnlistedStructure found = expect_only_structure(options, {"t_s", "bias", "power"});
  ASSERT_FALSE(found.parameters.empty());
  EXPECT_EQ(found.parameters.front().value, 0);
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
  const UnlistedStructure found =
      expect_only_structure(data, {"temp_C", "bias", "drawn through a play"});
  ASSERT_FALSE(found.parameters.empty());
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
// In rings up, the axis that the spindle points along takes it for steps and a hysteresis.
TEST(Structure, AScaleThatIsOffForAWhileIsAWindow) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.more_V[2] = [](const auto& a_g, double t_s) {
    return t_s > 230 && t_s < 480 ? 3e-3 * a_g[2] : 0.0;
  };
  expect_only_structure(options, {"t_s", "scale", "window"});
}

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

TEST(Structure, ACrossSensitivityThatJumpsIsAScale) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double t_s) { return t_s > 280 ? 2e-3 * a_g[1] : 0.0; };
  expect_only_structure(options, {"t_s", "scale", "step, times the component of the next axis"});
}

// As two steps of the humidity.
TEST(Structure, WhatLeaksBeyondSomeHumidityIsAPowerOfTheRest) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  const auto humidity = [](double t_s) { return 48 + 5 * std::sin(t_s / 70); };
  options.more_V[2] = [=](const auto&, double t_s) {
    return 2e-4 * std::pow(std::max(0.0, humidity(t_s) - 49), 1.5);
  };
  expect_only_structure(with_column(options, "rh_pct", humidity),
                        {"rh_pct", "bias", "power beyond a value"});
}

// As two waves.
TEST(Structure, AnOvenThatSettlesInSwingsIsAWaveThatDiesAway) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[1] = [](const auto&, double t_s) {
    return 8e-4 * std::exp(-(t_s - 61) / 150) * std::cos((t_s - 61) / 14);
  };
  expect_only_structure(options, {"t_s", "bias", "wave that dies away"});
}

// As a bend and a polynomial.
TEST(Structure, AFanThatPassesAResonanceIsOne) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  const auto rpm = [](double t_s) { return 2100 + 400 * std::sin(t_s / 37); };
  options.more_V[0] = [=](const auto&, double t_s) {
    const double x = (rpm(t_s) - 2180) / 60;
    return 6e-4 / (1 + x * x);
  };
  const UnlistedStructure found =
      expect_only_structure(with_column(options, "fan_rpm", rpm), {"fan_rpm", "bias", "resonance"});
  EXPECT_NEAR(found.parameters[0].value, 2180, 10);
}

// As a step of the scale, and a window to the end of the run.
TEST(Structure, WhatComesAndGoesGraduallyIsAWindowWithSoftEdges) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[2] = [](const auto& a_g, double t_s) {
    return 6e-4 * (std::tanh((t_s - 200) / 25) - std::tanh((t_s - 420) / 25)) * a_g[0];
  };
  expect_only_structure(options, {"t_s", "scale", "window, times the component of the next axis"});
}

// What the cross axes add before it is clipped they add after.
TEST(Structure, AStopOfTheComponentAloneIsSaturation) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    return 0.032 * (std::clamp(a_g[0], -0.85, 0.85) - a_g[0]);
  };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  ASSERT_THAT(result.diagnosis.effects, SizeIs(1)) << result.diagnosis.reason;
  EXPECT_EQ(result.diagnosis.effects[0].id, "sensor.saturation");
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
}

// As the column by name, harmonics of the spindle and poses at a wrong angle.
TEST(Structure, WhatAColumnDoesAtAPlaceIsOne) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  const auto moisture = [](double t_s) { return std::sin(t_s / 50); };
  const auto with_part = [&](const char* driver, const auto& is_there, const char* shape) {
    options.more_V[1] = [=](const auto& a_g, double t_s) {
      return is_there(a_g) ? 6e-4 * moisture(t_s) : 0;
    };
    expect_only_structure(with_column(options, driver, moisture), {driver, "bias", shape});
  };
  with_part(
      "rh_pct",
      [](const auto& a_g) {
        const double delta_rad = std::atan2(-a_g[1], a_g[0]);
        return delta_rad > 0.6 && delta_rad < 2.2;
      },
      "straight line in a part of delta_deg");
  with_part(
      "fan_V", [](const auto& a_g) { return a_g[2] < std::sin(0.61); },
      "straight line in a part of h_deg");
}

// As the column by itself, and a harmonic that follows it.
TEST(Structure, AFieldThatFollowsAColumnTurnsUnderTheTriad) {
  const auto field = [](double t_s) { return 45 + 3 * std::sin(t_s / 30) + std::cos(t_s / 11); };
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[1] = [field](const auto& a_g, double t_s) {
    const double delta_rad = std::atan2(-a_g[1], a_g[0]);
    const double along = 0.6 * a_g[2] * std::sin(delta_rad) - 0.4 * std::cos(delta_rad);
    return 2e-4 * (field(t_s) - 45) * along;
  };
  expect_only_structure(with_column(options, "mag_uT", field),
                        {"mag_uT", "bias", "straight line, times a field of the base"});
}

}  // namespace
}  // namespace plumbline
