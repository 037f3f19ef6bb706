#include "estimator/fit/least_squares.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace plumbline {
namespace {

// y = 1, 2, 4 at x = 0, 1, 2: slope 3/2, intercept 5/6, residual sum of squares 1/6; (AᵀA)⁻¹ =
// [5/6 −1/2; −1/2 1/2].
TEST(LeastSquares, StraightLineByHand) {
  Eigen::MatrixXd A(3, 2);
  A << 1, 0, 1, 1, 1, 2;
  const LeastSquaresResult fit = solve_least_squares(A, Eigen::Vector3d(1, 2, 4));
  EXPECT_EQ(fit.rank, 2);
  EXPECT_EQ(fit.degrees_of_freedom, 1);
  EXPECT_NEAR(fit.x(0), 5.0 / 6, 1e-15);
  EXPECT_NEAR(fit.x(1), 1.5, 1e-15);
  EXPECT_NEAR(fit.residual_sum_of_squares, 1.0 / 6, 1e-15);
  EXPECT_NEAR(fit.cofactor(0, 0), 5.0 / 6, 1e-15);
  EXPECT_NEAR(fit.cofactor(0, 1), -0.5, 1e-15);
  EXPECT_NEAR(fit.cofactor(1, 1), 0.5, 1e-15);
}

TEST(LeastSquares, RankDeficiencyIsAValueNotAFailure) {
  Eigen::MatrixXd A(4, 2);
  A << 1, 2, 1, 2, 1, 2, 1, 2;
  const LeastSquaresResult fit = solve_least_squares(A, Eigen::Vector4d(5, 5, 5, 5));
  EXPECT_EQ(fit.rank, 1);
  EXPECT_EQ(fit.cofactor.size(), 0);
  EXPECT_LT(fit.residual.norm(), 1e-12);
}

TEST(LeastSquares, ColumnScaleDoesNotMatter) {
  Eigen::MatrixXd A(5, 2);
  A << 1, 1e-12, 1, 2e-12, 1, 4e-12, 1, 3e-12, 1, 7e-12;
  const Eigen::VectorXd b = A * Eigen::Vector2d(2, 3e9);
  const LeastSquaresResult fit = solve_least_squares(A, b);
  ASSERT_EQ(fit.rank, 2);
  EXPECT_NEAR(fit.x(0), 2, 1e-14);
  EXPECT_NEAR(fit.x(1) / 3e9, 1, 1e-13);
}

TEST(Whitening, MakesTheCovarianceUnity) {
  Eigen::Matrix3d V;
  V << 4, 2, 0, 2, 5, 1, 0, 1, 3;
  const auto whitening = Whitening::of(V);
  ASSERT_TRUE(whitening);
  const Eigen::MatrixXd L_inverse = whitening->apply(Eigen::Matrix3d::Identity());
  EXPECT_LT((L_inverse * V * L_inverse.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_NEAR(L_inverse(0, 0), 0.5, 1e-15);
  EXPECT_EQ(L_inverse(0, 2), 0);
  EXPECT_LT((whitening->apply_transposed(L_inverse) * V - Eigen::Matrix3d::Identity()).norm(),
            1e-13);
}

TEST(Whitening, RefusesAnIndefiniteCovariance) {
  Eigen::Matrix2d V;
  V << 1, 2, 2, 1;
  EXPECT_FALSE(Whitening::of(V));
}

}  // namespace
}  // namespace plumbline
