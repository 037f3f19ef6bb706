#include <gtest/gtest.h>

#include <numbers>

#include "estimator/noise/powers_posterior.h"

namespace plumbline {
namespace {

Eigen::MatrixXd one(double a) { return Eigen::MatrixXd::Constant(1, 1, a); }
Eigen::VectorXd right(double b) { return Eigen::VectorXd::Constant(1, b); }

TEST(CovarianceOfPowers, OneThatIsFarFromZeroScattersAsItsInformationSays) {
  EXPECT_NEAR(covariance_of_powers(one(4e6), right(4e6 * 0.02))(0, 0), 1 / 4e6, 0.1 / 4e6);
}

TEST(CovarianceOfPowers, OneAtZeroIsHalfANormalDistribution) {
  const double expected = 1 - 2 / std::numbers::pi;
  EXPECT_NEAR(covariance_of_powers(one(1), right(0))(0, 0), expected, 0.1 * expected);
  EXPECT_LT(covariance_of_powers(one(1), right(-3))(0, 0), 0.2 * expected) << "ruled out by far";
}

TEST(CovarianceOfPowers, WhatHoldsForTheSumDoesNotHangOnItsParts) {
  for (const double b : {-1.0, 0.0, 2.0, 10.0}) {
    const double whole = covariance_of_powers(one(1), right(b))(0, 0);
    const Eigen::MatrixXd of_parts =
        covariance_of_powers(Eigen::MatrixXd::Constant(5, 5, 1), Eigen::VectorXd::Constant(5, b));
    EXPECT_NEAR(of_parts.sum(), whole, 0.15 * whole) << b;
    if (b > 5) {
      EXPECT_GT(of_parts(0, 0), 2 * whole) << "which part it is cannot be told";
    }
  }
}

TEST(CovarianceOfPowers, WhatIsNotLookedAtIsKnown) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2, 2);
  A(1, 1) = 1;
  const Eigen::MatrixXd covariance = covariance_of_powers(A, Eigen::Vector2d(0, 5));
  EXPECT_EQ(covariance.row(0).norm(), 0);
  EXPECT_NEAR(covariance(1, 1), 1, 0.1);
  EXPECT_EQ(covariance_of_powers(A, Eigen::Vector2d(0, 5)), covariance) << "the same every time";
}

}  // namespace
}  // namespace plumbline
