#include "estimator/noise/periodic_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "estimator/noise/identify.h"
#include "tests/estimator/wandering_line.h"

namespace plumbline {
namespace {

constexpr double kReadings_hz = 100;
constexpr double kLine_hz = 0.564;
constexpr double kNoise_V = 1e-3;  // of a reading

// A record, then windows of 40 readings every 2 s.
struct Readings {
  PerAxis<NoiseModel> noise;
  std::vector<SampleWindow> windows;
  PerAxis<Eigen::VectorXd> mean_V;
};
Readings readings(std::uint64_t seed, double amplitude_V, bool line_pauses) {
  constexpr Eigen::Index kWindows = 150;
  constexpr double kRecord_s = 600;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> white_V(0, kNoise_V);
  Readings made;
  for (Eigen::Index k = 0; k < kWindows; ++k)
    made.windows.push_back({kRecord_s + 2 * static_cast<double>(k), 1 / kReadings_hz, 40});
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto line = wandering_line(kLine_hz, 1e-3, 1000, random);
    std::vector<double> record_V;
    for (int i = 0; i < static_cast<int>(kRecord_s * kReadings_hz); ++i)
      record_V.push_back(white_V(random) + amplitude_V * line(i / kReadings_hz));
    made.noise[axis] = identify_noise(record_V, kReadings_hz);
    made.mean_V[axis].resize(kWindows);
    double running_s = kRecord_s;
    for (Eigen::Index k = 0; k < kWindows; ++k) {
      const SampleWindow& window = made.windows[static_cast<std::size_t>(k)];
      double sum_V = 0;
      for (std::size_t i = 0; i < window.count; ++i, running_s += window.step_s)
        sum_V += white_V(random) +
                 amplitude_V * line(line_pauses
                                        ? running_s
                                        : window.first_s + window.step_s * static_cast<double>(i));
      made.mean_V[axis](k) = sum_V / static_cast<double>(window.count);
    }
  }
  return made;
}

std::vector<FurtherNoise> possible(const Readings& made, bool goes_on = false) {
  return possible_noises(made.noise, made.windows, made.mean_V,
                         Eigen::MatrixXd::Ones(made.mean_V[0].size(), 1),
                         [=](std::size_t, const SpectralLine&) { return goes_on; });
}

TEST(PossibleNoises, WithoutALineThatMattersThereIsOne) {
  EXPECT_EQ(possible(readings(1, 0, false)).size(), 1);
  EXPECT_EQ(possible(readings(1, 0.02 * kNoise_V, false)).size(), 1);
}

TEST(PossibleNoises, ALineThatWandersThroughRecordAndRunIsLikeliest) {
  for (std::uint64_t seed = 1; seed < 5; ++seed) {
    const auto noises = possible(readings(seed, 0.6 * kNoise_V, false));
    ASSERT_EQ(noises.size(), 2) << seed;
    EXPECT_TRUE(noises.back().bands.empty()) << seed;
    ASSERT_FALSE(noises.front().bands.empty()) << seed;
    EXPECT_LT(noises.front().bands.front().f_hz, kLine_hz) << seed;
    EXPECT_GT(noises.front().bands.back().f_hz, kLine_hz) << seed;
    EXPECT_FALSE(noises.front().bands_pause) << seed;
  }
}

TEST(PossibleNoises, ALineThatGoesOnSteadilyIsNoNoise) {
  const auto noises = possible(readings(1, 0.6 * kNoise_V, false), true);
  ASSERT_EQ(noises.size(), 1);
  EXPECT_TRUE(noises.front().bands.empty());
}

TEST(PossibleNoises, TheClockOfTheLineMayStandStillBetweenTheWindows) {
  for (std::uint64_t seed = 1; seed < 5; ++seed) {
    const auto noises = possible(readings(seed, 0.6 * kNoise_V, true));
    ASSERT_EQ(noises.size(), 2) << seed;
    EXPECT_TRUE(noises.front().bands_pause) << seed;
  }
}

TEST(PossibleNoises, ARunWithoutTheLineOfTheRecordHasThatOfEveryRunFirst) {
  Readings made = readings(1, 0.6 * kNoise_V, false);
  made.mean_V = readings(2, 0, false).mean_V;
  const auto noises = possible(made);
  ASSERT_EQ(noises.size(), 2);
  EXPECT_TRUE(noises.front().bands.empty());
}

TEST(NarrowBand, CovarianceIsThatOfItsCourses) {
  constexpr int kCourses = 4000;
  const std::vector<SampleWindow> windows = {{0, 0.01, 40}, {1.3, 0.01, 40}, {40, 0.01, 80}};
  const Eigen::MatrixXd expected = narrow_band(windows, {kLine_hz, 0.02});
  std::mt19937_64 random(1);
  Eigen::MatrixXd found = Eigen::MatrixXd::Zero(3, 3);
  for (int course = 0; course < kCourses; ++course) {
    const auto line = wandering_line(kLine_hz, 0.02 / (2 * std::numbers::pi), 50, random);
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(3);
    for (Eigen::Index k = 0; k < 3; ++k) {
      const SampleWindow& window = windows[static_cast<std::size_t>(k)];
      for (std::size_t i = 0; i < window.count; ++i)
        mean(k) += line(window.first_s + window.step_s * static_cast<double>(i)) /
                   static_cast<double>(window.count);
    }
    found += mean * mean.transpose() / kCourses;
  }
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 0.06) << found << "\n" << expected;
}

}  // namespace
}  // namespace plumbline
