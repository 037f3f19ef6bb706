// What the readings of the dwells show before anything is fitted: bursts of noise, and lines.
#include "estimator/effects/dwell_line.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "estimator/effects/visit_log.h"
#include "estimator/pose_means.h"

#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

// 200 dwells of 40 samples of white noise.
MeasurementSet dwells_of_noise(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise_V(0, 3e-4);
  MeasurementSet set;
  for (int k = 0; k < 200; ++k) {
    set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 40});
    for (int m = 0; m < 40; ++m)
      for (auto& u_V : set.samples.u_V) u_V.push_back(noise_V(random));
  }
  return set;
}

TEST(PoseMeans, BurstsOfNoiseMakeAMeanLessCertain) {
  MeasurementSet set = dwells_of_noise(11);
  const Pose& loud = set.poses[17];
  for (std::size_t k = loud.first; k < loud.first + loud.count; ++k) set.samples.u_V[0][k] *= 4;
  // A single jump and a course within the dwell are no burst.
  set.samples.u_V[0][set.poses[30].first + 5] += 0.1;
  for (std::size_t k = 0; k < 40; ++k)
    set.samples.u_V[0][set.poses[40].first + k] += 1e-4 * static_cast<double>(k);
  const Eigen::VectorXd variance_V2 = burst_variance_V2(set, 0, 0);
  EXPECT_EQ((variance_V2.array() > 0).count(), 1);
  EXPECT_NEAR(variance_V2(17), 15 * 9e-8 / 40, 0.5 * 15 * 9e-8 / 40);
  EXPECT_TRUE(burst_variance_V2(set, 1, 0).isZero());
  EXPECT_TRUE(burst_variance_V2(set, 0, 1e-3).isZero());  // noise between two codes
}

// 200 dwells of 40 samples at 100 Hz with white noise, every 6.4 s as a raster has them, or a
// little more or less.
MeasurementSet dwells(std::uint64_t seed, double amplitude_V, double f_hz, double phase_rad,
                      double uneven_s = 0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise_V(0, 3e-4);
  std::uniform_real_distribution<double> more_s(0, uneven_s);
  MeasurementSet set;
  for (int k = 0; k < 200; ++k) {
    set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 40});
    const double arrival_s = 6.4 * k + (uneven_s > 0 ? more_s(random) : 0);
    for (int m = 0; m < 40; ++m) {
      const double t_s = arrival_s + 0.01 * m;
      set.samples.t_s.push_back(t_s);
      for (auto& u_V : set.samples.u_V)
        u_V.push_back(0.02 * std::sin(0.3 * k) + noise_V(random) +
                      amplitude_V * std::sin(2 * std::numbers::pi * f_hz * t_s + phase_rad));
    }
  }
  return set;
}

TEST(DwellLine, IsFoundAtItsFrequencyAmongTheAliasesOfTheRaster) {
  const auto line = line_through_dwells(dwells(1, 6e-4, 23.371, 1.2), 0);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 23.371, 1e-4);  // the next alias of the raster is 0.156 Hz away
  EXPECT_NEAR(line->amplitude_V, 6e-4, 2e-5);
  EXPECT_NEAR(std::remainder(line->phase_rad - 1.2, 2 * std::numbers::pi), 0, 0.1);
}

TEST(DwellLine, AboveHalfTheSamplingRateIsSeenAtItsAlias) {
  const auto line = line_through_dwells(dwells(2, 2e-4, 59.9, 0.4), 1);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 40.1, 1e-4);
}

TEST(DwellLine, AboveHalfTheSamplingRateIsKnownFromUnevenArrivals) {
  for (const double f_hz : {59.9, 133.7, 249.6, 550.2}) {
    const auto line = line_through_dwells(dwells(3, 2e-4, f_hz, 0.4, 0.5), 1);
    ASSERT_TRUE(line) << f_hz;
    EXPECT_NEAR(line->f_hz, f_hz, 1e-4);
    EXPECT_NEAR(line->amplitude_V, 2e-4, 2e-5);
    EXPECT_NEAR(std::remainder(line->phase_rad - 0.4, 2 * std::numbers::pi), 0, 0.2);
  }
}

// What the means of those dwells leave when the attitudes are taken out.
Eigen::VectorXd left_by_attitudes(const MeasurementSet& set) {
  Eigen::VectorXd left_V(std::ssize(set.poses));
  for (Eigen::Index k = 0; k < left_V.size(); ++k)
    left_V(k) = Eigen::Map<const Eigen::VectorXd>(set.samples.u_V[0].data() + 40 * k, 40).mean() -
                0.02 * std::sin(0.3 * static_cast<double>(k));
  return left_V;
}

TEST(DwellLine, ThatHardlyChangesWithinADwellShowsInTheMeans) {
  const MeasurementSet set = dwells(4, 2e-4, 100.6, 0.9, 0.5);
  EXPECT_FALSE(line_through_dwells(set, 0));
  const auto line = line_between_dwells(set, left_by_attitudes(set));
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 100.6, 1e-4);
  EXPECT_NEAR(line->amplitude_V, 2e-4, 4e-5);
  EXPECT_NEAR(std::remainder(line->phase_rad - 0.9, 2 * std::numbers::pi), 0, 0.3);
}

// Whatever the courses of the dwells show besides: what is removed from them as slow may leave of
// it what looks like a weaker one.
TEST(DwellLine, AStrongOneThatHardlyChangesWithinADwellComesFirst) {
  MeasurementSet set = dwells(4, 1e-2, 100.1, 0.9, 0.5);
  for (std::size_t k = 0; k < set.poses.size(); ++k)
    set.poses[k].delta_deg = 0.3 * static_cast<double>(k) * 180 / std::numbers::pi - 90;
  for (std::size_t i = 0; i < set.samples.size(); ++i)
    set.samples.u_V[0][i] += 3e-4 * std::sin(2 * std::numbers::pi * 23.4 * set.samples.t_s[i]);
  ASSERT_TRUE(line_through_dwells(set, 0));
  const auto line = make_visit_log(set, {}).line[0];
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 100.1, 1e-4);
  EXPECT_FALSE(make_visit_log(set, {}, {{0.12, 0.01}}).line[0]) << "part of the noise";
}

TEST(DwellLine, WhatDiesAwayInEveryDwellIsNotSteady) {
  MeasurementSet set = dwells(6, 2e-4, 23.371, 1.2);
  EXPECT_TRUE(line_through_dwells(set, 0)->steady);
  for (const Pose& pose : set.poses)
    for (std::size_t m = 0; m < pose.count; ++m) {
      const double t_s = 0.01 * static_cast<double>(m);
      set.samples.u_V[1][pose.first + m] +=
          2e-3 * std::exp(-t_s / 0.1) * std::sin(2 * std::numbers::pi * 18 * t_s);
    }
  const auto line = line_through_dwells(set, 1);
  ASSERT_TRUE(line);
  EXPECT_FALSE(line->steady);
}

TEST(DwellLine, ACourseOfTheRunIsNoLine) {
  // Slow waves and drifts are lines at every multiple of the sampling rate, too, where the arrivals
  // do not tell.
  for (const double uneven_s : {0.0, 0.5}) {
    const MeasurementSet set = dwells(5, 0, 0, 0, uneven_s);
    Eigen::VectorXd left_V = left_by_attitudes(set);
    for (Eigen::Index k = 0; k < left_V.size(); ++k)
      left_V(k) += 2e-4 * std::sin(0.05 * static_cast<double>(k)) + 1e-6 * static_cast<double>(k);
    EXPECT_FALSE(line_between_dwells(set, left_V)) << uneven_s;
  }
}

// In short dwells its aliases at the rate of the visits are as strong, and hardly change within a
// dwell either: a sine of 34 visits was a line of 0.31 Hz.
TEST(DwellLine, ASlowSineBetweenShortDwellsIsNoLine) {
  MeasurementSet set = dwells(5, 0, 0, 0);
  for (Pose& pose : set.poses) pose.count = 10;
  for (const double visits : {10.0, 20.0, 34.0, 90.0}) {
    Eigen::VectorXd left_V = left_by_attitudes(set);
    for (Eigen::Index k = 0; k < left_V.size(); ++k)
      left_V(k) += 1e-3 * std::sin(2 * std::numbers::pi * static_cast<double>(k) / visits);
    EXPECT_FALSE(line_between_dwells(set, left_V)) << visits;
  }
}

TEST(DwellLine, NoiseHasNone) {
  for (std::uint64_t seed = 10; seed < 20; ++seed)
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      EXPECT_FALSE(line_through_dwells(dwells(seed, 0, 0, 0), axis)) << seed;
  EXPECT_FALSE(line_through_dwells({}, 0));
}

}  // namespace
}  // namespace plumbline
