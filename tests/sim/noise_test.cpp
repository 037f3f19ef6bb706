// Each noise term against the Allan variance that defines it, with an Allan variance of its own.
#include "rig/sim/noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace plumbline::sim {
namespace {

constexpr double kRate_hz = 100;
constexpr std::size_t kSamples = 400'000;

struct Allan {
  double variance = 0;
  double differences = 0;
};

/// Non-overlapping Allan variance at τ = m/rate, by its definition.
Allan allan(const std::vector<double>& record, std::size_t m) {
  std::vector<double> means;
  for (std::size_t k = 0; k + m <= record.size(); k += m) {
    double sum = 0;
    for (std::size_t i = k; i < k + m; ++i) sum += record[i];
    means.push_back(sum / static_cast<double>(m));
  }
  Allan result{0, static_cast<double>(means.size() - 1)};
  for (std::size_t k = 0; k + 1 < means.size(); ++k) {
    result.variance += (means[k + 1] - means[k]) * (means[k + 1] - means[k]) / 2;
  }
  result.variance /= result.differences;
  return result;
}

std::vector<double> record_of(const NoiseTerms& terms, std::uint64_t seed = 1) {
  ChannelNoise noise(terms, kRate_hz, seed, 0);
  std::vector<double> record(kSamples);
  for (double& value : record) value = noise.next_V(1 / kRate_hz);
  return record;
}

/// Compares within five standard deviations: neighbouring differences share a mean, so the relative
/// variance of the estimate is at most 3/n.
void expect_allan(const NoiseTerms& terms, double (*variance)(double tau_s),
                  std::initializer_list<std::size_t> averages) {
  const auto record = record_of(terms);
  for (const std::size_t m : averages) {
    const Allan got = allan(record, m);
    const double expected = variance(static_cast<double>(m) / kRate_hz);
    EXPECT_NEAR(got.variance / expected, 1, 5 * std::sqrt(3 / got.differences)) << "m = " << m;
  }
}

TEST(Noise, QuantizationFallsAsTheSquareOfTime) {
  expect_allan({.Q = 2e-5}, [](double tau) { return 3 * 2e-5 * 2e-5 / (tau * tau); },
               {1, 4, 16, 64, 256});
}

TEST(Noise, WhiteNoiseFallsAsTime) {
  expect_allan({.N = 3e-5}, [](double tau) { return 3e-5 * 3e-5 / tau; }, {1, 4, 16, 64, 256});
}

TEST(Noise, FlickerIsFlat) {
  expect_allan({.B = 1e-4},
               [](double) { return 2 * 1e-4 * 1e-4 * std::numbers::ln2 / std::numbers::pi; },
               {16, 64, 256, 1024});
}

TEST(Noise, RandomWalkRisesAsTime) {
  expect_allan({.K = 1e-6}, [](double tau) { return 1e-6 * 1e-6 * tau / 3; }, {16, 64, 256, 1024});
}

TEST(Noise, RampIsAStraightLineOfEitherSign) {
  double signs = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto record = record_of({.R = 1e-6}, seed);
    EXPECT_NEAR(std::abs(record[1000] - record[0]), 1e-6 * 10, 1e-15);
    signs += record[1000] > record[0] ? 1 : -1;
  }
  EXPECT_LT(std::abs(signs), 19);
  const Allan got = allan(record_of({.R = 1e-6}), 100);
  EXPECT_NEAR(got.variance, 1e-12 / 2, 1e-18);
}

TEST(Noise, TimeMayPassInOneStepOrInMany) {
  // The random walk over a gap has the variance K²·gap, whatever lies in it.
  double sum = 0;
  constexpr int kRuns = 2000;
  for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
    ChannelNoise noise({.K = 1e-6}, kRate_hz, seed, 0);
    const double before = noise.next_V(0.01);
    const double step = noise.next_V(400) - before;
    sum += step * step;
  }
  EXPECT_NEAR(sum / kRuns / (1e-12 * 400), 1, 5 * std::sqrt(2.0 / kRuns));
}

TEST(Noise, AxesAndSeedsAreIndependent) {
  ChannelNoise x({.N = 1}, kRate_hz, 1, 0);
  ChannelNoise y({.N = 1}, kRate_hz, 1, 1);
  ChannelNoise other({.N = 1}, kRate_hz, 2, 0);
  double xy = 0;
  double xo = 0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    const double value = x.next_V(0.01);
    xy += value * y.next_V(0.01);
    xo += value * other.next_V(0.01);
  }
  // White noise of N = 1 has the variance 100 at 100 Hz.
  EXPECT_LT(std::abs(xy) / kCount, 100 * 5 / std::sqrt(kCount));
  EXPECT_LT(std::abs(xo) / kCount, 100 * 5 / std::sqrt(kCount));
}

}  // namespace
}  // namespace plumbline::sim
