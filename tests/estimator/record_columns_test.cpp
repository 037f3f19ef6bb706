// What a record at rest owes to the columns recorded with it is no noise.
#include "estimator/noise/record_columns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "estimator/noise/identify.h"

namespace plumbline {
namespace {

constexpr double kStep_s = 0.1;
constexpr std::size_t kSamples = 6000;
constexpr double kWhite_V = 1e-4;
constexpr double kWalk_V = 3e-6;  // of a sample

/// Independent Gaussian numbers or their sums.
class Draw {
 public:
  explicit Draw(unsigned seed) : engine_(seed) {}
  std::vector<double> white(double sigma) {
    std::vector<double> values(kSamples);
    for (double& v : values) v = sigma * gauss_(engine_);
    return values;
  }
  std::vector<double> walk(double sigma) {
    std::vector<double> values = white(sigma);
    for (std::size_t k = 1; k < values.size(); ++k) values[k] += values[k - 1];
    return values;
  }

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> gauss_;
};

std::vector<double> sum(std::vector<double> a, const std::vector<double>& b, double times = 1) {
  for (std::size_t k = 0; k < a.size(); ++k) a[k] += times * b[k];
  return a;
}

SampleTable table_with(std::vector<double> temp_C, std::vector<double> supply_V) {
  SampleTable table;
  table.t_s.resize(kSamples);
  table.temp_C = std::move(temp_C);
  table.covariates.push_back({"supply_V", std::move(supply_V)});
  return table;
}

TEST(RecordColumns, WhatFollowsAColumnIsTakenOut) {
  Draw draw(1);
  const SampleTable table = table_with(draw.walk(0.01), draw.walk(0.001));
  const std::vector<double> noise = draw.white(kWhite_V);
  std::vector<double> record = sum(noise, table.temp_C, 2e-4);
  const NoiseModel before = identify_noise(record, 1 / kStep_s);
  ASSERT_TRUE(before.K.present || before.R.present);
  EXPECT_EQ(take_out_columns(record, table, 0, kStep_s), std::vector<std::string>{"temp_C"});
  const NoiseModel after = identify_noise(record, 1 / kStep_s);
  EXPECT_FALSE(after.K.present || after.R.present);
  EXPECT_LT(after.K.value, 0.1 * before.K.value);
  // But for a constant and the uncertainty of the slope, what is left is the noise.
  double mean = 0, square = 0;
  for (std::size_t k = 0; k < kSamples; ++k) mean += (record[k] - noise[k]) / kSamples;
  for (std::size_t k = 0; k < kSamples; ++k)
    square += std::pow(record[k] - noise[k] - mean, 2) / kSamples;
  EXPECT_LT(std::sqrt(square), 4 * kWhite_V / std::sqrt(kSamples));
}

/// In white noise, to which something is added that `follows` the temperature.
void expect_no_walk_left(unsigned seed, const std::function<double(double)>& follows) {
  Draw draw(seed);
  const SampleTable table = table_with(draw.walk(0.01), draw.walk(0.001));
  std::vector<double> record = draw.white(kWhite_V);
  for (std::size_t k = 0; k < kSamples; ++k) record[k] += follows(table.temp_C[k]);
  const NoiseModel before = identify_noise(record, 1 / kStep_s);
  ASSERT_TRUE(before.K.present || before.R.present);
  EXPECT_EQ(take_out_columns(record, table, 0, kStep_s), std::vector<std::string>{"temp_C"});
  const NoiseModel after = identify_noise(record, 1 / kStep_s);
  EXPECT_LT(after.K.value, 0.35 * before.K.value);
}

TEST(RecordColumns, PlayInTheTemperatureIsTakenOut) {
  expect_no_walk_left(5, [at = 0.0](double temp_C) mutable {
    at = std::clamp(at, temp_C - 0.2, temp_C + 0.2);
    return 2e-3 * at;
  });
}

TEST(RecordColumns, WhatLagsBehindTheTemperatureIsTakenOut) {
  expect_no_walk_left(6, [past = 0.0](double temp_C) mutable {
    past += (temp_C - past) * kStep_s / 60;
    return 2e-3 * past;
  });
}

TEST(RecordColumns, TwoColumnsBesideARandomWalk) {
  Draw draw(2);
  const SampleTable table = table_with(draw.walk(0.01), draw.walk(0.001));
  const std::vector<double> walk = draw.walk(kWalk_V);
  std::vector<double> record = sum(sum(sum(draw.white(kWhite_V), walk), table.temp_C, 2e-3),
                                   table.covariates.front().value, 0.02);
  const std::vector<std::string> names = take_out_columns(record, table, 0, kStep_s);
  EXPECT_EQ(names.size(), 2U);
  // The walk is still there to be identified.
  const NoiseModel after = identify_noise(record, 1 / kStep_s);
  EXPECT_TRUE(after.K.present);
  EXPECT_NEAR(after.K.value, kWalk_V / std::sqrt(kStep_s), 0.5 * kWalk_V / std::sqrt(kStep_s));
}

// Beside a walk neither the line nor the play alone says anything: only one less the other.
TEST(RecordColumns, WhatAPlayKeepsBackOfALineIsTakenOut) {
  Draw draw(7);
  std::vector<double> temp_C(kSamples), kept_back(kSamples);
  double at = 0;
  for (std::size_t k = 0; k < kSamples; ++k) {
    const double turns = 1.4 * static_cast<double>(k) / kSamples;
    temp_C[k] = std::sin(2 * std::numbers::pi * turns);
    at = std::clamp(at, temp_C[k] - 0.25, temp_C[k] + 0.25);
    kept_back[k] = at - temp_C[k];
  }
  const SampleTable table = table_with(temp_C, draw.walk(0.001));
  std::vector<double> record = sum(sum(draw.white(kWhite_V), draw.walk(kWalk_V)), kept_back, 2e-3);
  EXPECT_EQ(take_out_columns(record, table, 0, kStep_s), std::vector<std::string>{"temp_C"});
  const NoiseModel after = identify_noise(record, 1 / kStep_s);
  EXPECT_NEAR(after.K.value, kWalk_V / std::sqrt(kStep_s), 0.5 * kWalk_V / std::sqrt(kStep_s));
}

TEST(RecordColumns, AWalkThatHappensToLookLikeAColumnIsLeftAlone) {
  int taken = 0;
  constexpr int kRecords = 150;
  for (unsigned seed = 100; seed < 100 + kRecords; ++seed) {
    Draw draw(seed);
    const SampleTable table = table_with(draw.walk(0.01), draw.walk(0.001));
    std::vector<double> record = sum(draw.white(kWhite_V), draw.walk(kWalk_V));
    const std::vector<double> as_recorded = record;
    if (take_out_columns(record, table, 0, kStep_s).empty())
      EXPECT_EQ(record, as_recorded);
    else
      ++taken;
  }
  EXPECT_LE(taken, 3);  // 0.3 expected
}

TEST(RecordColumns, NothingIsTakenFromWhatCannotTell) {
  Draw draw(3);
  SampleTable table = table_with(draw.walk(0.01), std::vector<double>(kSamples, 5.0));
  std::vector<double> constant(kSamples, 1.0),
      brief(table.temp_C.begin(), table.temp_C.begin() + 50);
  EXPECT_TRUE(take_out_columns(constant, table, 0, kStep_s).empty());
  EXPECT_TRUE(take_out_columns(brief, table, 0, kStep_s).empty());
  // On one code but for a few readings, however much they follow the temperature.
  std::vector<double> codes = table.temp_C;
  for (double& v : codes) v = v > 0.5 ? 1.0 : 0.0;
  const std::vector<double> as_recorded = codes;
  EXPECT_TRUE(take_out_columns(codes, table, 0, kStep_s).empty());
  EXPECT_EQ(codes, as_recorded);
  table.temp_C[7] = std::nan("");
  std::vector<double> record = sum(draw.white(kWhite_V), draw.walk(0.01));
  EXPECT_TRUE(take_out_columns(record, table, 0, kStep_s).empty());
}

TEST(RecordColumns, AStretchInTheMiddleOfTheTable) {
  Draw draw(4);
  SampleTable table = table_with(draw.walk(0.01), draw.walk(0.001));
  const std::vector<double> whole = sum(draw.white(kWhite_V), table.temp_C, 1e-3);
  constexpr std::size_t kFirst = 2000, kCount = 3000;
  std::vector<double> record(whole.begin() + kFirst, whole.begin() + kFirst + kCount);
  EXPECT_EQ(take_out_columns(record, table, kFirst, kStep_s), std::vector<std::string>{"temp_C"});
  const NoiseModel after = identify_noise(record, 1 / kStep_s);
  EXPECT_FALSE(after.K.present);
}

}  // namespace
}  // namespace plumbline
