// What has no name and comes from the component that an axis feels, or from its codes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

using testing::AnyOf;
using testing::IsEmpty;
using testing::SizeIs;

TEST(Structure, AGainThatFallsBeyondTheSameSizeOnBothSidesIsOneBend) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    const double beyond_g = std::max(0.0, std::abs(a_g[0]) - 0.6);
    return 3e-3 * std::copysign(beyond_g, a_g[0]);
  };
  expect_only_structure(options, {"a_x", "bias", "bend"});
}

// As a saw tooth and a bend.
TEST(Structure, AnAmplifierThatChangesItsRangeHasAnotherGainBeyond) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[1] = [](const auto& a_g, double) {
    return std::abs(a_g[1]) > 0.55 ? 8e-4 * a_g[1] : 0.0;
  };
  expect_only_structure(options, {"a_y", "bias", "gain beyond a value"});
}

// As a polynomial of degree 12 and a wave.
TEST(Structure, WhatTouchesBeyondAValueOfAnotherComponentIsAStepOfTheScale) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) { return a_g[1] > 0.3 ? 4e-4 * a_g[0] : 0; };
  expect_only_structure(options, {"a_y", "scale", "step"});
}

TEST(Structure, ASeamBetweenTwoSegmentsIsOne) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[0] = [](const auto& a_g, double) {
    const double x = (a_g[0] - 0.2) / 0.16;
    return 5e-4 * x * std::exp(-0.5 * x * x);
  };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(1)) << result.diagnosis.reason;
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  EXPECT_EQ(result.diagnosis.unlisted[0].shape, "seam");
  EXPECT_THAT(result.diagnosis.unlisted[0].driver, AnyOf("a_x", "code_x"));
}

// As two waves and a polynomial of degree 8.
TEST(Structure, ABitThatIsFeltOnAnotherAxisIsOne) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  SampleTable& samples = data.run.samples;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const auto code = std::lround((samples.u_V[0][k] - kSixteenBits.min_V) / kSixteenBits.lsb_V());
    if ((code >> 8) % 2 == 1) samples.u_V[1][k] += 4 * kSixteenBits.lsb_V();
  }
  const UnlistedStructure found =
      expect_only_structure(data, {"code_x", "bias", "bit of the code"});
  EXPECT_EQ(found.axes, std::vector<std::size_t>{1});
  EXPECT_NEAR(found.parameters[1].value, 256 * kSixteenBits.lsb_V(), 1e-12);
}

// As a step of the code, a seam and a drift of the scale.
TEST(Structure, CodesThatAreMissingAreABand) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  constexpr int kFirst = -1000, kLast = -960;  // read as the one after the last
  for (double& u_V : data.run.samples.u_V[0]) {
    const auto code = std::lround((u_V - kSixteenBits.volts(0)) / kSixteenBits.lsb_V());
    if (code >= kFirst && code <= kLast) u_V = kSixteenBits.volts(kLast + 1);
  }
  expect_only_structure(data, {"code_x", "bias", "band that is missing"});
}

// As the gain by itself, and a step.
TEST(Structure, ARangeBeyondAValueHasAZeroOfItsOwn) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  options.more_V[0] = [](const auto& a_g, double) {
    return a_g[0] > 0.52 ? 1.5e-3 * a_g[0] - 1.2e-3 : 0;
  };
  expect_only_structure(options, {"a_x", "bias", "gain beyond a value"});
}

// As a saw tooth and waves.
TEST(Structure, ACarryThatLiftsPartOfThePatternIsATrainOfPulses) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.more_V[0] = [](const auto& a_g, double) {
    const double share = 0.45 + a_g[0] / 0.31;
    return share - std::floor(share) < 0.3 ? 3e-4 : 0;
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"a_x", "bias", "train of pulses"});
  EXPECT_NEAR(parameter(found, "period").value, 0.31, 0.01);
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

}  // namespace
}  // namespace plumbline
