// Settling, judged on windows whose noise, slope and steps are known.
#include "app/sequencer/settling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace plumbline::app {
namespace {

constexpr double kSampleRate_Hz = 100;
const Adc kAdc{16, -5.0, 0.0};  // a step of 76.3 µV
constexpr double kNoise_V = 0.0005;

/// `signal_V` of time in seconds on all axes, plus white noise.
std::vector<RawSample> record(std::size_t count, const std::function<double(double)>& signal_V,
                              double noise_V = kNoise_V) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1);
  std::vector<RawSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i].counter = static_cast<std::int64_t>(i);
    samples[i].t_s = static_cast<double>(i) / kSampleRate_Hz;
    for (auto& code : samples[i].code) {
      const double volts = signal_V(samples[i].t_s) + noise_V * noise(random);
      code = static_cast<std::int32_t>(std::lround((volts - kAdc.volts(0)) / kAdc.lsb_V()));
    }
  }
  return samples;
}

double at_rest(double /*t_s*/) { return -2.5; }

NoiseFloor floor_of(double sd_V) { return white_noise_floor(sd_V, kAdc, 20, kSampleRate_Hz); }

/// Time of the first sample at which the detector is satisfied, negative when it never is.
double settled_s(const std::vector<RawSample>& samples, std::optional<NoiseFloor> floor) {
  SettlingDetector detector(SettlingOptions{}, kAdc, kSampleRate_Hz, floor);
  for (const RawSample& sample : samples)
    if (detector.add(sample)) return sample.t_s;
  return -1;
}

// n = 20: sqrt(12 / (20·399)) = 0.038778 steps of 1/100 s, so 3.8778 V/s for 1 V.
TEST(NoiseFloor, WhiteNoiseBySlopeFormula) {
  const NoiseFloor floor = white_noise_floor(0.001, kAdc, 20, kSampleRate_Hz);
  EXPECT_DOUBLE_EQ(floor.sd_V[0], 0.001);
  EXPECT_NEAR(floor.slope_sd_V_s[2], 0.0038778, 1e-6);
}

TEST(NoiseFloor, NeverBelowHalfAStepOfTheConverter) {
  EXPECT_NEAR(white_noise_floor(0, kAdc, 20, kSampleRate_Hz).sd_V[1], 38.15e-6, 0.01e-6);
}

TEST(NoiseFloor, IsLearntFromARecordAtRest) {
  auto soak = record(20000, at_rest);
  for (std::size_t i = 0; i < 2000; ++i)
    soak[i].code[0] += static_cast<int>(i % 7) * 100;  // a knock
  const auto floor = learn_noise_floor(soak, kAdc, 20, kSampleRate_Hz);
  ASSERT_TRUE(floor.has_value());
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    EXPECT_NEAR(floor->sd_V[axis], kNoise_V, 0.05 * kNoise_V);
    // A tenth of knocked windows turns the median into the 56 % quantile: 1.14 times as much.
    const double expected_V_s = 3.8778 * kNoise_V * (axis == 0 ? 1.14 : 1.0);
    EXPECT_NEAR(floor->slope_sd_V_s[axis], expected_V_s, 0.1 * expected_V_s);
  }
}

TEST(NoiseFloor, IsUnknownWithoutAWholeWindow) {
  EXPECT_FALSE(learn_noise_floor(record(19, at_rest), kAdc, 20, kSampleRate_Hz).has_value());
  auto broken = record(20, at_rest);
  for (std::size_t i = 10; i < broken.size(); ++i) broken[i].counter += 5;
  EXPECT_FALSE(learn_noise_floor(broken, kAdc, 20, kSampleRate_Hz).has_value());
}

TEST(Settling, AQuietOutputTakesOneWindow) {
  EXPECT_NEAR(settled_s(record(100, at_rest), floor_of(kNoise_V)), 0.19, 0.05);
}

TEST(Settling, WaitsForAnExponentialToDie) {
  const auto dying = [](double t_s) { return -2.5 + 0.5 * std::exp(-t_s / 0.2); };
  const double settled = settled_s(record(1000, dying), floor_of(kNoise_V));
  // What is left of the slope then lies within four standard errors, 7.8 mV/s: 0.5/0.2·exp(−t/0.2)
  // falls to that at 1.15 s in the middle of a window of 0.2 s.
  EXPECT_GT(settled, 0.9);
  EXPECT_LT(settled, 1.8);
}

TEST(Settling, WaitsForAnOscillationWithoutSlope) {
  const auto ringing = [](double t_s) {
    return -2.5 + (t_s < 1 ? 0.01 * std::sin(2 * M_PI * 20 * t_s) : 0.0);  // 4 periods a window
  };
  EXPECT_GT(settled_s(record(300, ringing), floor_of(kNoise_V)), 1.1);
}

TEST(Settling, NeverOnASteadyRampOrOverloadedNoise) {
  EXPECT_LT(
      settled_s(record(500, [](double t_s) { return -2.5 + 0.05 * t_s; }), floor_of(kNoise_V)), 0);
  EXPECT_LT(settled_s(record(500, at_rest, 5 * kNoise_V), floor_of(kNoise_V)), 0);
}

TEST(Settling, AGapStartsTheWindowAnew) {
  auto samples = record(60, at_rest);
  for (std::size_t i = 15; i < samples.size(); ++i) samples[i].counter += 1;
  EXPECT_GE(settled_s(samples, floor_of(kNoise_V)), 0.15 + 0.19 - 1e-9);
}

TEST(Settling, WithoutAFloorTheSlopeIsJudgedByTheWindowsOwnScatter) {
  EXPECT_GT(settled_s(record(100, at_rest, 5 * kNoise_V), std::nullopt), 0.18);
  EXPECT_LT(settled_s(record(500, [](double t_s) { return -2.5 + 0.05 * t_s; }), std::nullopt), 0);
}

}  // namespace
}  // namespace plumbline::app
