#include "estimator/outlying_readings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace plumbline {
namespace {

constexpr std::size_t kPoses = 60, kReadings = 40;

/// Poses at levels from −1 to 1 V, with Gaussian noise of 1 mV in one axis.
MeasurementSet noisy_set(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1e-3);
  MeasurementSet set;
  for (std::size_t pose = 0; pose < kPoses; ++pose) {
    set.poses.push_back(
        {.number = static_cast<long long>(pose), .first = pose * kReadings, .count = kReadings});
    for (std::size_t k = 0; k < kReadings; ++k) {
      set.samples.t_s.push_back(static_cast<double>(set.samples.size()) * 0.01);
      for (auto& u_V : set.samples.u_V)
        u_V.push_back(std::cos(0.7 * static_cast<double>(pose)) + noise(random));
    }
  }
  return set;
}

std::vector<std::size_t> rows(const std::vector<OutlyingReading>& readings) {
  std::vector<std::size_t> rows;
  for (const OutlyingReading& reading : readings) rows.push_back(reading.row);
  return rows;
}

TEST(OutlyingReadings, AreFoundWhereTheyAreAndNowhereElse) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    MeasurementSet set = noisy_set(seed);
    EXPECT_THAT(outlying_readings(set, 0, {}), testing::IsEmpty()) << seed;
    set.samples.u_V[1][403] += 20e-3;
    set.samples.u_V[1][911] -= 3;
    const MeasurementSet given = set;
    EXPECT_THAT(replace_outlying(set, {}), testing::ElementsAre(0, 2, 0)) << seed;
    EXPECT_EQ(set.samples.u_V[1][403], given.samples.u_V[1][402]);
    EXPECT_EQ(set.samples.u_V[1][911], given.samples.u_V[1][910]);
    EXPECT_EQ(set.samples.u_V[0], given.samples.u_V[0]);
  }
}

TEST(OutlyingReadings, SettlingIsNone) {
  MeasurementSet set = noisy_set(1);
  for (const Pose& pose : set.poses) set.samples.u_V[0][pose.first] += 0.1;
  EXPECT_THAT(outlying_readings(set, 0, {}), testing::IsEmpty());
  set.samples.u_V[0][500] += 0.1;  // in the middle of a dwell
  EXPECT_THAT(rows(outlying_readings(set, 0, {})), testing::ElementsAre(500));
}

TEST(OutlyingReadings, WhatComesInEveryDwellIsNone) {
  MeasurementSet set = noisy_set(1);
  for (const Pose& pose : set.poses) set.samples.u_V[0][pose.first + 23] += 0.1;
  EXPECT_THAT(outlying_readings(set, 0, {}), testing::IsEmpty());
  set.samples.u_V[0][500] += 0.1;  // the 20th of a dwell
  EXPECT_THAT(rows(outlying_readings(set, 0, {})), testing::ElementsAre(500));
}

TEST(OutlyingReadings, AStepWithinADwellIsNone) {
  MeasurementSet set = noisy_set(1);
  for (std::size_t k = 400 + 37; k < 440; ++k) set.samples.u_V[0][k] += 0.1;
  EXPECT_THAT(outlying_readings(set, 0, {}), testing::IsEmpty());
}

// Noise carries single readings over the edge of a step in the converter's characteristic.
TEST(OutlyingReadings, AStepOfTheConverterIsNone) {
  MeasurementSet set = noisy_set(2);
  const double edge_V = std::cos(0.7 * 5) + 2.3e-3;
  for (std::size_t pose = 1; pose < kPoses; pose += 2)
    for (std::size_t k = 0; k < kReadings; ++k)
      set.samples.u_V[0][pose * kReadings + k] +=
          std::cos(0.7 * 5) - std::cos(0.7 * static_cast<double>(pose));
  for (double& u_V : set.samples.u_V[0])
    if (u_V > edge_V) u_V += 50e-3;
  EXPECT_THAT(outlying_readings(set, 0, {}), testing::IsEmpty());
}

TEST(OutlyingReadings, NoiseThatIsOftenFarOffIsNoise) {
  MeasurementSet set = noisy_set(3);
  for (std::size_t k = 5; k < set.samples.size(); k += 20) set.samples.u_V[0][k] += 0.1;
  EXPECT_THAT(outlying_readings(set, 0, {}), testing::IsEmpty());
}

TEST(OutlyingReadings, CodesOfACoarseConverterAreNone) {
  MeasurementSet set = noisy_set(4);
  const Adc adc{.bits = 9, .min_V = -2, .max_V = 2};  // steps of 8 standard deviations
  for (double& u_V : set.samples.u_V[0]) u_V = adc.lsb_V() * std::round(u_V / adc.lsb_V());
  EXPECT_THAT(outlying_readings(set, 0, adc), testing::IsEmpty());
  set.samples.u_V[0][500] += 20 * adc.lsb_V();
  EXPECT_THAT(rows(outlying_readings(set, 0, adc)), testing::ElementsAre(500));
}

TEST(OutlyingReadings, OfARecordAreFoundInAWalk) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1e-3);
  std::vector<double> record;
  double level_V = 0;
  for (std::size_t k = 0; k < 5000; ++k) {
    level_V += 0.2 * noise(random);
    record.push_back(level_V + noise(random));
  }
  EXPECT_THAT(outlying_readings(record), testing::IsEmpty());
  record[1234] += 15e-3;
  EXPECT_THAT(rows(outlying_readings(record)), testing::ElementsAre(1234));
}

}  // namespace
}  // namespace plumbline
