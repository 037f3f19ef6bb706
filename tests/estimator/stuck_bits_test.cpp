// Bits of a converter that are stuck, given back to the readings.
#include "estimator/diagnosis/stuck_bits.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

constexpr std::size_t kReadings = 40;

struct Dwells {
  std::vector<Pose> poses;
  std::vector<double> u_V;      ///< as a sound converter reads them
  std::vector<double> stuck_V;  ///< as one with a stuck bit does
  Eigen::VectorXd voltage_V;    ///< what is measured
  Eigen::VectorXd expectation_V;
  double off_V = 0;
};

/// Voltages all over a few steps of the bit, expected with an error of up to `off` of its weight.
Dwells dwells(int count, const StuckBit& stuck, double sd_V, double off, unsigned seed) {
  const double lsb_V = kSixteenBits.lsb_V(), weight_V = std::ldexp(lsb_V, stuck.bit);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise_V(0, sd_V);
  std::uniform_real_distribution<double> anywhere_V(-2.6, -2.6 + 9 * weight_V), error(-off, off);
  Dwells all{{}, {}, {}, Eigen::VectorXd(count), Eigen::VectorXd(count), off * weight_V};
  for (int k = 0; k < count; ++k) {
    all.voltage_V(k) = anywhere_V(random);
    all.expectation_V(k) = all.voltage_V(k) + error(random) * weight_V;
    Pose pose;
    pose.first = all.u_V.size();
    pose.count = kReadings;
    all.poses.push_back(pose);
    for (std::size_t r = 0; r < kReadings; ++r) {
      const long long code = std::llround((all.voltage_V(k) + noise_V(random) + 5) / lsb_V);
      const long long bit = 1LL << stuck.bit;
      const long long read = stuck.value ? code | bit : code & ~bit;
      all.u_V.push_back(-5 + lsb_V * static_cast<double>(code));
      all.stuck_V.push_back(-5 + lsb_V * static_cast<double>(read));
    }
  }
  return all;
}

TEST(StuckBits, EveryReadingComesBackWhereNoiseIsSmall) {
  const double sd_V = 3 * kSixteenBits.lsb_V();
  for (const bool value : {false, true}) {
    const StuckBit stuck{5, value};  // 32 codes
    const Dwells all = dwells(400, stuck, sd_V, 0.35, 1);
    std::vector<double> u_V = all.stuck_V;
    give_bits_back({stuck}, kSixteenBits, sd_V, all.expectation_V, all.off_V, all.poses, u_V);
    for (std::size_t r = 0; r < u_V.size(); ++r) ASSERT_NEAR(u_V[r], all.u_V[r], 1e-9) << r;
  }
}

// The nearest code is the wrong one for every tenth reading here, on one side only: taken for the
// right one, it would move means by 1.7 times what the noise of 40 readings does. Next to an edge
// 40 readings tell less.
TEST(StuckBits, MeansAreTrueOnAverageWhereNoiseReachesOverTheBit) {
  const double sd_V = 3.2 * kSixteenBits.lsb_V();
  const StuckBit stuck{3, true};  // 8 codes
  const Dwells all = dwells(4000, stuck, sd_V, 0.2, 2);
  std::vector<double> u_V = all.stuck_V;
  give_bits_back({stuck}, kSixteenBits, sd_V, all.expectation_V, all.off_V, all.poses, u_V);
  const double weight_V = std::ldexp(kSixteenBits.lsb_V(), stuck.bit);
  // By where in the two codes' worth of the bit the voltage lies.
  constexpr int kParts = 4;
  std::array<double, kParts> sum_V{}, square_V2{}, count{};
  for (std::size_t k = 0; k < all.poses.size(); ++k) {
    const double voltage_V = all.voltage_V(static_cast<Eigen::Index>(k));
    double mean_V = 0;
    for (std::size_t r = 0; r < kReadings; ++r)
      mean_V += u_V[all.poses[k].first + r] / static_cast<double>(kReadings);
    const double phase = std::fmod((voltage_V + 5) / weight_V, 2.0);
    const auto part = static_cast<std::size_t>(phase / 2 * kParts);
    sum_V[part] += mean_V - voltage_V;
    square_V2[part] += std::pow(mean_V - voltage_V, 2);
    count[part] += 1;
  }
  const double ideal_V = sd_V / std::sqrt(static_cast<double>(kReadings));
  for (std::size_t part = 0; part < kParts; ++part) {
    EXPECT_LT(std::abs(sum_V[part] / count[part]), 0.4 * ideal_V) << part;
    EXPECT_LT(std::sqrt(square_V2[part] / count[part]), 2.5 * ideal_V) << part;
  }
}

TEST(StuckBits, SeveralComeBackTogether) {
  const double sd_V = 1.5 * kSixteenBits.lsb_V();
  const std::vector<StuckBit> stuck = {{4, true}, {6, false}};
  Dwells all = dwells(400, stuck.back(), sd_V, 0.1, 3);
  for (double& u_V : all.stuck_V) {
    const long long code = std::llround((u_V + 5) / kSixteenBits.lsb_V()) | (1LL << 4);
    u_V = -5 + kSixteenBits.lsb_V() * static_cast<double>(code);
  }
  // Right to less than half of the smaller one.
  all.expectation_V = all.voltage_V + 0.15 * (all.expectation_V - all.voltage_V);
  all.off_V *= 0.15;
  std::vector<double> u_V = all.stuck_V;
  give_bits_back(stuck, kSixteenBits, sd_V, all.expectation_V, all.off_V, all.poses, u_V);
  for (std::size_t r = 0; r < u_V.size(); ++r) ASSERT_NEAR(u_V[r], all.u_V[r], 1e-9) << r;
}

}  // namespace
}  // namespace plumbline
