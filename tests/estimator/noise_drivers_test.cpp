// Noise that follows something shows in no mean: it is told by the scatter within the dwells.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

using testing::IsEmpty;

SyntheticOptions fine_grid() {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  return options;
}

void expect_noise_of_x(const Calibration& result, const char* driver, const char* shape,
                       double ratio) {
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::explained);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  ASSERT_EQ(result.diagnosis.unlisted.size(), 1U);
  const UnlistedStructure& found = result.diagnosis.unlisted.front();
  EXPECT_EQ(found.driver, driver);
  EXPECT_EQ(found.form, "sample");
  EXPECT_EQ(found.shape, shape);
  EXPECT_EQ(found.axes, std::vector<std::size_t>{0});
  EXPECT_LT(found.p_value, 1e-4);
  EXPECT_GT(found.heldout_gain, 0.5);
  ASSERT_EQ(found.parameters.size(), 1U);
  EXPECT_NEAR(found.parameters[0].value, ratio, 5 * found.parameters[0].u);
}

TEST(NoiseDrivers, NoiseThatGrowsWithWhatTheAxisFeels) {
  SyntheticOptions options = fine_grid();
  options.noise_x = [](const auto& a_g, double) { return std::exp(0.7 * std::abs(a_g[0])); };
  const SyntheticRun data = synthetic_run(3, kSixteenBits, options);
  const Calibration result = calibrated(data);
  expect_noise_of_x(result, "a_x", "noise, straight line in its size", std::exp(0.7));
  // It is in no mean, so another set lacks nothing of the model.
  EXPECT_THAT(evaluate(certified_model(result), data.run, data.description).left_out, IsEmpty());
}

TEST(NoiseDrivers, NoiseThatEveryArrivalBringsAlong) {
  SyntheticOptions options = fine_grid();
  options.noise_x = [](const auto&, double since_s) { return since_s < 0.05 ? 2 : 1; };
  expect_noise_of_x(calibrated(synthetic_run(4, kSixteenBits, options)), "t_in_pose",
                    "noise, first quarter against the rest", 2);
}

// In an order in which h rises with the time, a parabola of a_z came nearer than one of the time.
TEST(NoiseDrivers, NoiseOfWhatWasSwitchedOn) {
  SyntheticOptions options = fine_grid();
  constexpr int kFirst = 70;  // arrival
  options.noise_x = [arrivals = 0](const auto&, double since_s) mutable {
    if (since_s == 0) ++arrivals;
    return arrivals > kFirst ? 2 : 1;
  };
  expect_noise_of_x(calibrated(synthetic_run(4, kSixteenBits, options)), "t_s", "noise, step", 2);
}

// As a parabola of a_z.
TEST(NoiseDrivers, NoiseThatWasThereForAWhile) {
  SyntheticOptions options = fine_grid();
  constexpr int kFirst = 60, kLast = 120;  // arrivals
  options.noise_x = [arrivals = 0](const auto&, double since_s) mutable {
    if (since_s == 0) ++arrivals;
    return arrivals > kFirst && arrivals <= kLast ? 2 : 1;
  };
  expect_noise_of_x(calibrated(synthetic_run(4, kSixteenBits, options)), "t_s", "noise, window", 2);
}

// Poses with less noise say more: with all alike the parameters err by half as much again.
TEST(NoiseDrivers, QuietPosesCountForMore) {
  SyntheticOptions options = fine_grid();
  options.noise_x = [](const auto& a_g, double) { return std::exp(3 * std::abs(a_g[0])); };
  double square = 0, expected = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const SyntheticRun data = synthetic_run(seed, kSixteenBits, options);
    const AxisEstimate x = calibrated(data).estimates.batch_ls[0];
    for (Eigen::Index k = 0; k < 4; ++k) {
      square +=
          std::pow(x.value(k) - data.truth[0][static_cast<std::size_t>(k)], 2) / x.covariance(k, k);
      ++expected;
    }
  }
  EXPECT_GT(square / expected, 0.5);
  EXPECT_LT(square / expected, 1.6);
}

// The readings scatter most where the current is large: as noise that follows it.
TEST(NoiseDrivers, TheSquareOfACurrentThatIsNotSteadyIsNoNoise) {
  SyntheticOptions options = fine_grid();
  std::vector<double> current_A;
  options.more_V[0] = [&current_A, random = std::mt19937_64(8)](const auto&, double t_s) mutable {
    const double mean_A = 0.5 * std::sin(t_s / 100);
    current_A.push_back(std::normal_distribution<double>(mean_A, 0.1)(random));
    return 2e-3 * current_A.back() * current_A.back();
  };
  SyntheticRun data = synthetic_run(4, kSixteenBits, options);
  const auto first = current_A.end() - std::ssize(data.run.samples.t_s);
  data.run.samples.covariates.push_back({"motor_A", {first, current_A.end()}});
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  ASSERT_EQ(result.diagnosis.unlisted.size(), 1U);
  EXPECT_EQ(result.diagnosis.unlisted.front().driver, "motor_A");
  EXPECT_EQ(result.diagnosis.unlisted.front().form, "bias");
}

TEST(NoiseDrivers, NoiseThatFollowsNothingHasNoDriver) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Calibration result = calibrated(synthetic_run(seed, kSixteenBits));
    EXPECT_THAT(result.diagnosis.unlisted, IsEmpty()) << seed << result.diagnosis.reason;
  }
}

// It passed for slow noise that the record, at rest and shorter, happened not to show: "clean".
TEST(NoiseDrivers, ABiasThatWandersAsTheRecordNeverDidIsSaid) {
  SyntheticOptions options = fine_grid();
  options.more_V[0] = [random = std::mt19937_64(8), level_V = 0.0, next_s = 61.0](
                          const auto&, double t_s) mutable {
    constexpr double kSize_V = 3e-4;
    if (t_s < next_s) return level_V;
    next_s += std::uniform_real_distribution<double>(5, 25)(random);
    level_V = std::normal_distribution<double>(0, kSize_V)(random);
    return level_V;
  };
  const Calibration result = calibrated(synthetic_run(6, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::partly_explained);
  ASSERT_FALSE(result.diagnosis.unlisted.empty());
  const UnlistedStructure& found = result.diagnosis.unlisted.back();
  EXPECT_EQ(found.driver, "t_s");
  EXPECT_EQ(found.form, "bias");
  EXPECT_EQ(found.shape, "noise, wandering beyond the static record");
  EXPECT_EQ(found.axes, std::vector<std::size_t>{0});
  EXPECT_GT(found.heldout_gain, 0.5);
}

// Beyond its limit an axis is quiet.
TEST(NoiseDrivers, ALimitExplainsItsQuietReadings) {
  constexpr std::uint64_t kSeed = 5;
  constexpr double kLimit_g = 0.7;
  SyntheticOptions options = fine_grid();
  const auto x = synthetic_run(kSeed, kSixteenBits, options).truth[0];
  const auto clipped_g = [=](const auto& a_g) {
    const double response_g = (x[0] * a_g[0] + x[1] * a_g[1] + x[2] * a_g[2]) / x[0];
    return std::clamp(response_g, -kLimit_g, kLimit_g) - response_g;
  };
  options.more_V[0] = [x, clipped_g](const auto& a_g, double) { return x[0] * clipped_g(a_g); };
  options.noise_x = [clipped_g](const auto& a_g, double) { return clipped_g(a_g) == 0 ? 1 : 0.2; };
  const Calibration result = calibrated(synthetic_run(kSeed, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  ASSERT_EQ(result.diagnosis.effects.size(), 1U);
  EXPECT_EQ(result.diagnosis.effects[0].id, "sensor.saturation");
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
}

}  // namespace
}  // namespace plumbline
