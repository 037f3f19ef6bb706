// What has no name and shows within the dwells.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

SyntheticOptions long_dwells() {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.samples_per_pose = 40;
  return options;
}

/// In a synthetic run; negative in the record.
double since_arrival_s(double t_s) {
  constexpr double kFirst_s = 61, kPose_s = 3;
  return t_s < kFirst_s ? -1 : t_s - kFirst_s - kPose_s * std::floor((t_s - kFirst_s) / kPose_s);
}

// As ringing and a polynomial.
TEST(Structure, ABrakeThatReleasesInTheDwellIsAStepThere) {
  SyntheticOptions options = long_dwells();
  options.more_V[0] = [](const auto&, double t_s) {
    return since_arrival_s(t_s) > 0.265 ? 3e-4 : 0.0;
  };
  const UnlistedStructure found = expect_only_structure(options, {"t_in_pose", "sample", "step"});
  EXPECT_NEAR(found.parameters[0].value, 0.265, 0.006);
  EXPECT_NEAR(found.parameters[1].value, 3e-4 / 0.032, 4 * found.parameters[1].u);
}

// Far beyond the noise: as outlying readings it was left out.
TEST(Structure, AReadingThatIsDisturbedInEveryDwellIsAWindowThere) {
  for (const double size_V : {2e-4, 5e-3}) {
    SyntheticOptions options = long_dwells();
    options.more_V[2] = [=](const auto&, double t_s) {
      return std::abs(since_arrival_s(t_s) - 0.23) < 0.005 ? size_V : 0.0;
    };
    const UnlistedStructure found =
        expect_only_structure(options, {"t_in_pose", "sample", "window"});
    EXPECT_NEAR(found.parameters[0].value, 0.225, 1e-6);
    EXPECT_NEAR(found.parameters[1].value, 0.235, 1e-6);
  }
}

// As pickup by name.
TEST(Structure, AMachineThatRunsNowAndThenIsALineOfItsColumn) {
  SyntheticOptions options = long_dwells();
  options.random_order = true;
  const auto runs = [](double t_s) { return std::sin(t_s / 40) > 0.2 ? 1.0 : 0.0; };
  options.more_V[1] = [=](const auto&, double t_s) {
    return 2e-4 * runs(t_s) * std::sin(2 * std::numbers::pi * 21.7 * t_s);
  };
  expect_only_structure(with_column(options, "compressor_on", runs),
                        {"compressor_on", "sample", "straight line, times a sine"});
}

// As pickup and lines of columns that happened to run alike.
TEST(Structure, AShakingAcrossTheSpindleIsALineOfTheAttitude) {
  SyntheticOptions options = long_dwells();
  options.more_V[1] = [](const auto& a_g, double t_s) {
    return 3e-4 * (1 - a_g[2] * a_g[2]) * std::sin(2 * std::numbers::pi * 33.8 * t_s);
  };
  expect_only_structure(options, {"a_z", "sample", "parabola, times a sine"});
}

/// A base that is shaken along x_b, y_b and z_b by these, g.
SyntheticRun on_a_shaken_base(const std::array<double, 3>& shaken_g) {
  SyntheticOptions options = long_dwells();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    options.more_V[axis] = [=](const auto& a_g, double t_s) {
      const double delta_rad = delta_deg_of(a_g) * kRadPerDeg;
      const double h_rad = h_deg_of(a_g) * kRadPerDeg;
      const double sd = std::sin(delta_rad), cd = std::cos(delta_rad);
      const double x_b[] = {-std::sin(h_rad) * cd, std::sin(h_rad) * sd, std::cos(h_rad)};
      const double y_b[] = {-sd, -cd, 0};
      constexpr double kK_V_per_g[] = {0.032, 0.0314, -0.0328};
      const double along_g =
          shaken_g[0] * x_b[axis] + shaken_g[1] * y_b[axis] + shaken_g[2] * a_g[axis];
      const bool machine_runs = since_arrival_s(t_s) >= 0;
      return machine_runs ? kK_V_per_g[axis] * along_g * std::sin(2 * std::numbers::pi * 23.7 * t_s)
                          : 0;
    };
  return synthetic_run(7, kSixteenBits, options);
}

// As lines of each axis that are as strong as the attitude says.
TEST(Structure, ABaseThatIsShakenSwingsOrIsLifted) {
  constexpr double kShaken_g = 0.01;
  const auto shaken = [&](const std::array<double, 3>& shaken_g, const char* shape) {
    const UnlistedStructure found =
        expect_only_structure(on_a_shaken_base(shaken_g), {"t_in_pose", "geometry", shape});
    return parameter(found, "amplitude");
  };
  const EffectParameter lifted = shaken({0, 0, kShaken_g}, "sine, added to gravity");
  EXPECT_NEAR(lifted.value, kShaken_g, 4 * lifted.u);
  const EffectParameter swung = shaken({kShaken_g, 0, 0}, "sine, added to h");
  EXPECT_NEAR(swung.value * kRadPerDeg, kShaken_g, 4 * swung.u * kRadPerDeg);
  const EffectParameter rolled = shaken({0, kShaken_g, 0}, "sine, added to the base roll");
  EXPECT_NEAR(rolled.value * kRadPerDeg, kShaken_g, 4 * rolled.u * kRadPerDeg);

  const Calibration askew = calibrated(on_a_shaken_base({0.8 * kShaken_g, 0.6 * kShaken_g, 0}));
  SCOPED_TRACE(askew.diagnosis.reason);
  EXPECT_THAT(askew.diagnosis.effects, testing::IsEmpty());
  ASSERT_THAT(askew.diagnosis.unlisted, testing::SizeIs(2));
  for (const UnlistedStructure& part : askew.diagnosis.unlisted)
    EXPECT_THAT(part.shape, testing::AnyOf("sine, added to h", "sine, added to the base roll"));
}

// As one that was right on arrival, and a tilt index that made up for it.
TEST(Structure, AHeadThatSinksAboutItsPlaceIsRightOnAverage) {
  constexpr double kTau_s = 0.1;
  constexpr double kMean = 0.252;  // of exp(-t/0.1 s) over 40 readings of 10 ms
  SyntheticOptions options = long_dwells();
  options.base_tilt_rad = [](double t_s) {
    const double since_s = since_arrival_s(t_s + 1e-9);
    return since_s < 0 ? 0 : 5e-3 * (std::exp(-since_s / kTau_s) - kMean);
  };
  const UnlistedStructure found = expect_only_structure(
      options, {"t_in_pose", "geometry", "exponential after arrival, added to h"});
  EXPECT_EQ(parameter(found, "true_at").value, 2);
  EXPECT_NEAR(parameter(found, "tau").value, kTau_s, 4 * parameter(found, "tau").u);
}

// As ringing and a polynomial of the change of h.
TEST(Structure, WhatALongMoveHeatsCoolsDownInTheDwell) {
  SyntheticOptions options = long_dwells();
  options.random_order = true;
  options.more_V[0] = [pose = -1.0, h_rad = 0.0, way_rad = 0.0](const auto& a_g,
                                                                double t_s) mutable {
    const double since_s = since_arrival_s(t_s + 1e-9);
    if (since_s < 0) return 0.0;
    if (const double now = std::round((t_s - since_s) / 3); now != pose) {
      pose = now;
      const double to_rad = std::asin(std::clamp(a_g[2] / 1.0004, -1.0, 1.0));
      way_rad = std::abs(to_rad - h_rad);
      h_rad = to_rad;
    }
    return 1e-3 * way_rad * std::exp(-since_s / 0.15);
  };
  const UnlistedStructure found = expect_only_structure(
      options,
      {"t_in_pose", "sample", "exponential after arrival, times the change of h on the way"});
  EXPECT_NEAR(found.parameters[0].value, 0.15, 0.05);
}

}  // namespace
}  // namespace plumbline
