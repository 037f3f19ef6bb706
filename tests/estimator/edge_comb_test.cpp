#include "estimator/diagnosis/edge_comb.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace plumbline {
namespace {

constexpr Eigen::Index kSteps = 240;
constexpr double kDistance_s = 6;

/// In a random walk alone, steps are differences of neighbouring readings: orthonormal once
/// whitened.
std::optional<EdgeComb> best_of(const Eigen::VectorXd& products) {
  std::vector<double> at_s;
  for (Eigen::Index k = 1; k <= kSteps; ++k) at_s.push_back(kDistance_s * static_cast<double>(k));
  return best_edge_comb(at_s, products, Eigen::MatrixXd::Identity(kSteps, kSteps));
}

Eigen::VectorXd noise(std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  return Eigen::VectorXd::NullaryExpr(kSteps, [&] { return normal(generator); });
}

TEST(EdgeComb, FindsManySmallEdgesAtRegularTimes) {
  constexpr double kPeriod_s = 111.3, kUp_s = 47, kWidth_s = 38, kEdge = 3;  // sigma
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    Eigen::VectorXd products = noise(seed);
    for (double t_s = kUp_s; t_s < kDistance_s * kSteps; t_s += kPeriod_s) {
      const auto step_after = [](double edge_s) {
        return static_cast<Eigen::Index>(std::ceil(edge_s / kDistance_s)) - 1;
      };
      products(step_after(t_s)) += kEdge;
      if (step_after(t_s + kWidth_s) < kSteps) products(step_after(t_s + kWidth_s)) -= kEdge;
    }
    const auto found = best_of(products);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->period_s, kPeriod_s, 0.01 * kPeriod_s);
    EXPECT_NEAR(found->width_s, kWidth_s, 1.5 * kDistance_s);
    EXPECT_GT(found->gain, 60);
  }
}

TEST(EdgeComb, GainsNoMoreInNoiseThanSoManyLooksMay) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) EXPECT_LT(best_of(noise(seed))->gain, 36) << seed;
}

TEST(EdgeComb, SaysNothingOfAFewReadings) {
  EXPECT_FALSE(best_edge_comb({1, 2, 3}, Eigen::Vector3d(1, 2, 3), Eigen::Matrix3d::Identity()));
}

}  // namespace
}  // namespace plumbline
