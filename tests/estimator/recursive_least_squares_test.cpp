#include "estimator/fit/recursive_least_squares.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "estimator/fit/least_squares.h"

namespace plumbline {
namespace {

RC_GTEST_PROP(RecursiveLeastSquares, EqualsBatchAfterEveryRow, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint32_t>();
  const auto rows = *rc::gen::inRange<Eigen::Index>(6, 80);
  const double noise = std::pow(10.0, *rc::gen::inRange(-6, 1));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;

  Eigen::MatrixXd A(rows, 4);
  for (double& value : A.reshaped()) value = normal(random);
  const Eigen::Vector4d truth(0.032, -0.0017, 7e-5, -2.58);
  Eigen::VectorXd b = A * truth;
  for (double& value : b) value += noise * normal(random);

  RecursiveLeastSquares recursive(1e8 * noise);
  for (Eigen::Index row = 0; row < rows; ++row) {
    recursive.add(A.row(row) / noise, b(row) / noise);
    if (row < 5) continue;
    const LeastSquaresResult batch =
        solve_least_squares(A.topRows(row + 1) / noise, b.head(row + 1) / noise);
    const AxisEstimate estimate = recursive.estimate();
    RC_ASSERT((estimate.value - batch.x).norm() <= 1e-10 * batch.x.norm() * (1 + noise * 1e3));
    RC_ASSERT((estimate.covariance - batch.cofactor).norm() <= 1e-8 * batch.cofactor.norm());
  }
}

TEST(RecursiveLeastSquares, KeepsThePriorWhereNothingWasSeen) {
  RecursiveLeastSquares recursive(1e3);
  recursive.add({1, 0, 0, 0}, 2.0);
  const AxisEstimate estimate = recursive.estimate();
  EXPECT_NEAR(estimate.value(0), 2.0, 1e-5);
  EXPECT_EQ(estimate.value(2), 0.0);
  EXPECT_NEAR(estimate.covariance(0, 0), 1.0, 1e-5);
  EXPECT_NEAR(estimate.covariance(2, 2), 1e6, 1e-6);
}

}  // namespace
}  // namespace plumbline
