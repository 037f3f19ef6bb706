// What several effects together look like, and what the search makes of it.
#include "estimator/diagnosis/search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"
#include "tests/estimator/wandering_line.h"

namespace plumbline {
namespace {

using testing::Field;
using testing::IsEmpty;
using testing::SizeIs;
using testing::UnorderedElementsAre;

SyntheticOptions full_grid() {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  return options;
}

// Of opposite signs on x and y they turn the specific force like an ellipticity of delta.
TEST(Search, ThreeCubicsAreNoErrorOfTheHead) {
  SyntheticOptions options = full_grid();
  const std::array<double, 3> k3_V_per_g3 = {5e-4, -5e-4, 4e-4};
  for (std::size_t i = 0; i < kAxisCount; ++i)
    options.more_V[i] = [i, k3 = k3_V_per_g3[i]](const auto& a_g, double) {
      return k3 * std::pow(a_g[i], 3);
    };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  ASSERT_THAT(result.diagnosis.effects, SizeIs(1));
  EXPECT_EQ(result.diagnosis.effects.front().id, "sensor.cubic");
  EXPECT_THAT(result.diagnosis.effects.front().axes, SizeIs(3));
}

/// A course of the second-order process of Kostyuk & Lakoza's ramp (2012, eq. 6) with variance 1,
/// as a sum of waves with its density.
std::function<double(double)> smooth_noise(double bend_rad_per_s, std::mt19937_64& random) {
  constexpr int kWaves = 200;
  constexpr double kHighest = 6;  // of the bend; the density falls with the fourth power
  std::normal_distribution<double> normal;
  std::vector<std::array<double, 3>> waves;  // frequency, rad/s, and amplitudes
  double variance = 0;
  for (int k = 0; k < kWaves; ++k) {
    const double x = kHighest * (k + 0.5) / kWaves, density = 1 / (1 + std::pow(x, 4));
    waves.push_back({x * bend_rad_per_s, std::sqrt(density) * normal(random),
                     std::sqrt(density) * normal(random)});
    variance += density;
  }
  return [waves, scale = 1 / std::sqrt(variance)](double t_s) {
    double sum = 0;
    for (const auto& [omega, c, s] : waves)
      sum += c * std::cos(omega * t_s) + s * std::sin(omega * t_s);
    return scale * sum;
  };
}

// Smoother than any walk, and as large in the record: of such noise a third of the runs was a wave,
// a bell or a polynomial of the time.
TEST(Search, SmoothNoiseThatTheRecordShowsIsNoEffect) {
  SyntheticOptions options;
  constexpr double kRun_s = 180;
  options.still_s = 1.4 * kRun_s;
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    std::mt19937_64 random(seed);
    for (auto& more_V : options.more_V)
      more_V = [noise = smooth_noise(2 * std::numbers::pi * 1.5 / kRun_s, random)](
                   const auto&, double t_s) { return 3e-4 * noise(t_s); };
    const Calibration result = calibrated(synthetic_run(seed, kSixteenBits, options));
    EXPECT_EQ(result.diagnosis.verdict, Verdict::clean) << seed << ": " << result.diagnosis.reason;
  }
}

/// A line in record and run, three times as large as the noise of a pose, V.
constexpr double kLine_V = 2e-4, kLine_hz = 0.564;
SyntheticOptions long_run() {
  SyntheticOptions options;
  options.delta_step_deg = 20;
  options.h_step_deg = 10;
  options.still_s = 400;
  return options;
}

// It was a wave of the time, a train of pulses, a step of the bias.
TEST(Search, ALineThatWandersInRecordAndRunIsNoEffect) {
  for (std::uint64_t seed = 0; seed < 2; ++seed) {
    SyntheticOptions options = long_run();
    std::mt19937_64 random(seed);
    for (auto& more_V : options.more_V)
      more_V = [line = wandering_line(kLine_hz, 2e-3, 1000, random)](const auto&, double t_s) {
        return kLine_V * line(t_s);
      };
    const Calibration result = calibrated(synthetic_run(seed, kSixteenBits, options));
    EXPECT_EQ(result.diagnosis.verdict, Verdict::clean) << seed << ": " << result.diagnosis.reason;
    EXPECT_THAT(result.noise[0].remark, testing::HasSubstr("counted as noise"));
  }
}

TEST(Search, ALineThatIsSteadyInRecordAndRunIsAnEffect) {
  SyntheticOptions options = long_run();
  options.more_V[0] = [](const auto&, double t_s) {
    return kLine_V * std::sin(2 * std::numbers::pi * kLine_hz * t_s);
  };
  const Calibration result = calibrated(synthetic_run(1, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  ASSERT_THAT(result.diagnosis.effects, SizeIs(1));
  EXPECT_EQ(result.diagnosis.effects.front().id, "adc.mains_pickup");
  EXPECT_THAT(result.diagnosis.effects.front().axes, testing::ElementsAre(0));
}

// With noise of a third of a step and more, rounding hardly moves a mean.
TEST(Search, APoseThatIsOffIsFoundInReadingsOfACoarseConverter) {
  SyntheticOptions options = full_grid();
  options.samples_per_pose = 40;
  options.sigma_V = 0.4 * kTwelveBits.lsb_V();
  options.delta_error_deg = [](double delta_deg, double h_deg) {
    return delta_deg == 60 && h_deg == 20 ? 1.3 : 0;
  };
  const Calibration result = calibrated(synthetic_run(7, kTwelveBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  EXPECT_THAT(result.diagnosis.effects,
              UnorderedElementsAre(Field(&FoundEffect::id, "rig.pose_outlier")));
}

// A polynomial of a component holds its cube, and both together nearly the component itself.
TEST(Search, AFifthPowerIsNoCubeBesideAPolynomial) {
  SyntheticOptions options = full_grid();
  options.samples_per_pose = 40;
  options.more_V[1] = [](const auto& a_g, double) { return 1.2e-3 * std::pow(a_g[1], 5); };
  const SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(1));
  EXPECT_EQ(result.diagnosis.unlisted.front().driver, "a_y");
  EXPECT_NEAR(result.final.batch_ls[1].value(1) / data.truth[1][1], 1, 0.05);
}

// What varies while the base is tilted is not the tilt.
TEST(Search, DriftsBesideATiltedBaseAreNoTiltThatFollowsTheTime) {
  SyntheticOptions options = full_grid();
  options.base_roll_rad = [](double) { return 0.02; };
  const std::array<double, 3> drift_V_per_s = {4e-7, -3e-7, 3e-7};
  for (std::size_t i = 0; i < kAxisCount; ++i)
    options.more_V[i] = [drift = drift_V_per_s[i]](const auto&, double t_s) { return drift * t_s; };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  EXPECT_THAT(result.diagnosis.effects,
              UnorderedElementsAre(Field(&FoundEffect::id, "rig.base_roll"),
                                   Field(&FoundEffect::id, "sensor.drift")));
  // What the Monte Carlo method compares is the certified estimate: with the effects, which tie the
  // axes and cost some of their certainty.
  ASSERT_TRUE(result.uncertainty);
  EXPECT_TRUE(result.uncertainty->validated);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      const ParameterUncertainty& p = result.uncertainty->parameter[i][static_cast<std::size_t>(j)];
      const double u = std::sqrt(result.final.batch_ls[i].covariance(j, j));
      EXPECT_NEAR(p.mc_mean, result.final.batch_ls[i].value(j), 0.05 * u);
      EXPECT_NEAR(p.budget.combined, u, 0.02 * u);
      EXPECT_NEAR(p.mc_u, u, 0.03 * u);
    }
  }
}

// A polynomial of h holds the sine of h, but for the last digits: the sensitivity to z came out
// five orders of magnitude too large, and poses beyond the highest tilt as much in error.
TEST(Search, AFunctionOfTheTiltDoesNotTakeThePlaceOfASensitivity) {
  SyntheticOptions options = full_grid();
  options.sigma_V = 1e-5;
  options.more_V[1] = [](const auto& a_g, double) {
    const double h_deg = std::asin(std::min(a_g[2], 1.0)) * 180 / std::numbers::pi;
    return 3e-3 * std::sin(2 * std::numbers::pi * h_deg / 35 + 0.7);
  };
  const SyntheticRun data = synthetic_run(7, kTwelveBits, options);
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_NEAR(result.final.batch_ls[1].value(2), data.truth[1][2], 3e-3);
  EXPECT_LT(result.after.heldout_pose_rms_mps2[1], 0.5 * result.before.heldout_pose_rms_mps2[1]);
}

// A head that comes to rest anew at every pose: no function of anything, but ten times the noise
// that the record speaks of, so that among thousands of functions some look good.
TEST(Search, WhatEveryPoseHasForItselfHasNoDriver) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    SyntheticOptions options = full_grid();
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      options.more_V[axis] = [seed, axis](const std::array<double, 3>&, double t_s) {
        if (t_s < 61) return 0.0;
        std::seed_seq pose{static_cast<std::uint64_t>((t_s - 61) / 3 + 1e-6), seed, axis};
        std::mt19937_64 random(pose);
        return std::normal_distribution<double>(0, 8e-4)(random);
      };
    const Calibration result = calibrated(synthetic_run(seed, kSixteenBits, options));
    EXPECT_TRUE(result.diagnosis.effects.empty()) << result.diagnosis.reason;
    for (const UnlistedStructure& found : result.diagnosis.unlisted)
      EXPECT_TRUE(found.is_of_noise()) << found.driver << ": " << found.shape;
    EXPECT_NE(result.diagnosis.verdict, Verdict::clean);
  }
}

// The sine of it is zero at every position, and a fit of both is not determined: it was found by
// another name.
TEST(Search, APeriodicErrorWithTwoPositionsAPeriodHasItsName) {
  SyntheticOptions options;
  options.delta_step_deg = 20;
  options.h_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double) {
    return 0.15 * std::cos(9 * delta_deg * std::numbers::pi / 180);
  };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  ASSERT_THAT(result.diagnosis.effects, SizeIs(1));
  EXPECT_EQ(result.diagnosis.effects.front().id, "rig.delta_periodic");
}

}  // namespace
}  // namespace plumbline
