#include "estimator/fit/generalised_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/error_figures.h"
#include "estimator/fit/least_squares.h"

namespace plumbline {
namespace {

using testing::HasSubstr;

std::vector<PoseMean> poses_at(const std::vector<std::pair<double, double>>& angles_deg) {
  std::vector<PoseMean> poses;
  for (const auto& [delta_deg, h_deg] : angles_deg) {
    PoseMean mean;
    mean.pose.delta_deg = delta_deg;
    mean.pose.h_deg = h_deg;
    poses.push_back(mean);
  }
  return poses;
}

std::vector<PoseMean> grid() {
  std::vector<std::pair<double, double>> angles_deg;
  for (int h = 0; h <= 80; h += 20)
    for (int delta = 0; delta < 360; delta += 30) angles_deg.emplace_back(delta, h);
  return poses_at(angles_deg);
}

Observability of(const std::vector<std::pair<double, double>>& angles_deg) {
  return observability(design_matrix(poses_at(angles_deg), {}));
}

TEST(ObservabilityNames, FullRankHasNothingToName) {
  const Observability result = observability(design_matrix(grid(), {}));
  EXPECT_EQ(result.rank, 4);
  EXPECT_EQ(result.unobservable, "");
  EXPECT_GT(result.condition, 1);
  EXPECT_LT(result.condition, 6);
}

TEST(ObservabilityNames, OnePose) {
  EXPECT_EQ(of({{10, 20}}).rank, 1);
  EXPECT_THAT(of({{10, 20}}).unobservable, HasSubstr("only one pose"));
}

TEST(ObservabilityNames, AllPosesEqual) {
  EXPECT_THAT(of({{10, 20}, {10, 20}, {10, 20}, {10, 20}, {10, 20}}).unobservable,
              HasSubstr("all poses are equal"));
}

TEST(ObservabilityNames, LevelSpindleSaysNothingAboutZ) {
  const Observability result = of({{0, 0}, {90, 0}, {180, 0}, {270, 0}, {45, 0}});
  EXPECT_EQ(result.rank, 3);
  EXPECT_EQ(result.unobservable, "K_z: a_z is zero at every pose");
}

TEST(ObservabilityNames, OneTilt) {
  const Observability result = of({{0, 40}, {90, 40}, {180, 40}, {270, 40}, {45, 40}});
  EXPECT_EQ(result.rank, 3);
  EXPECT_EQ(result.unobservable, "K_z cannot be told from U_0: a_z is the same at every pose");
}

TEST(ObservabilityNames, ThreePoses) {
  const Observability result = of({{0, 0}, {100, 30}, {200, 60}});
  EXPECT_EQ(result.rank, 3);
  EXPECT_THAT(result.unobservable, HasSubstr("only 3 poses"));
}

/// Exponentially correlated, variances growing along the run.
Eigen::MatrixXd coloured_covariance(Eigen::Index n) {
  Eigen::MatrixXd V(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      V(i, j) = std::exp(-0.1 * static_cast<double>(std::abs(i - j))) +
                (i == j ? 0.5 + 0.01 * static_cast<double>(i) : 0.0);
  return 1e-9 * V;
}

Eigen::VectorXd noisy_voltages(const Eigen::MatrixXd& A, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd y = A * Eigen::Vector4d(0.032, -0.0017, 7e-5, -2.58);
  for (double& value : y) value += 5e-5 * normal(random);
  return y;
}

TEST(GeneralisedFit, IsTheAitkenEstimate) {
  const Eigen::MatrixXd A = design_matrix(grid(), {});
  const Eigen::VectorXd y = noisy_voltages(A, 1);
  const Eigen::MatrixXd V = coloured_covariance(A.rows());
  const auto fit = fit_generalised(A, y, V);
  ASSERT_TRUE(fit);
  const Eigen::MatrixXd V_inverse = V.inverse();
  const Eigen::Matrix4d C = (A.transpose() * V_inverse * A).inverse();
  const Eigen::Vector4d x = C * A.transpose() * V_inverse * y;
  EXPECT_LT((fit->estimate.value - x).norm(), 1e-11);
  EXPECT_LT((fit->estimate.covariance - C).norm(), 1e-9 * C.norm());
  EXPECT_LT((fit->gain * y - x).norm(), 1e-11);
  EXPECT_LT((fit->gain * A - Eigen::Matrix4d::Identity()).norm(), 1e-11);
  EXPECT_NEAR(fit->whitened_residual.squaredNorm(),
              fit->residual_V.dot(V_inverse * fit->residual_V), 1e-9 * 60);
}

TEST(GeneralisedFit, HeldOutResidualsAreThoseOfARefit) {
  const std::vector<PoseMean> poses = grid();
  const Eigen::MatrixXd A = design_matrix(poses, {});
  const Eigen::VectorXd y = noisy_voltages(A, 2);
  const Eigen::MatrixXd V = coloured_covariance(A.rows());
  for (const Blocks& blocks : {time_blocks(poses), position_blocks(poses)}) {
    const HeldoutResiduals fast = heldout_residuals(A, y, V, blocks);
    ASSERT_TRUE(fast.residual_V.allFinite());
    for (const auto& block : blocks) {
      std::vector<Eigen::Index> rest;
      for (Eigen::Index row = 0; row < A.rows(); ++row)
        if (std::find(block.begin(), block.end(), row) == block.end()) rest.push_back(row);
      const auto refit = fit_generalised(A(rest, Eigen::all), y(rest), V(rest, rest));
      ASSERT_TRUE(refit);
      // y_B − A_B·(gain of the rest)·y_rest, of readings that are correlated
      const Eigen::MatrixXd by_rest = A(block, Eigen::all) * refit->gain;
      const Eigen::MatrixXd between = by_rest * V(rest, block);
      const Eigen::MatrixXd covariance = V(block, block) - between - between.transpose() +
                                         by_rest * V(rest, rest) * by_rest.transpose();
      for (std::size_t k = 0; k < block.size(); ++k) {
        const Eigen::Index row = block[k];
        EXPECT_NEAR(fast.residual_V(row), y(row) - A.row(row).dot(refit->estimate.value), 1e-12);
        const auto at = static_cast<Eigen::Index>(k);
        EXPECT_NEAR(fast.sd_V(row), std::sqrt(covariance(at, at)), 1e-9 * fast.sd_V(row));
      }
    }
  }
}

TEST(GeneralisedFit, BlocksThatCannotBeSparedAreNotHeldOut) {
  const std::vector<PoseMean> poses = poses_at({{0, 0}, {90, 0}, {180, 0}, {270, 0}, {45, 50}});
  const Eigen::MatrixXd A = design_matrix(poses, {});
  const Eigen::VectorXd y = noisy_voltages(A, 3);
  const Eigen::VectorXd heldout =
      heldout_residuals(A, y, Eigen::MatrixXd::Identity(5, 5), {{0}, {4}}).residual_V;
  EXPECT_TRUE(std::isfinite(heldout(0)));
  EXPECT_TRUE(std::isnan(heldout(4)));  // the only pose that sees a_z
  EXPECT_TRUE(std::isnan(heldout(1)));  // in no block
}

TEST(ErrorFigures, BlocksCoverEveryPoseOnce) {
  const std::vector<PoseMean> poses = grid();
  for (const Blocks& blocks : {time_blocks(poses), position_blocks(poses)}) {
    std::vector<int> seen(poses.size());
    for (const auto& block : blocks)
      for (const Eigen::Index row : block) ++seen[static_cast<std::size_t>(row)];
    EXPECT_THAT(seen, testing::Each(1));
    EXPECT_GE(blocks.size(), 8u);
  }
}

// White noise of variance v leaves v·(n − 4)/n.
TEST(ErrorFigures, ExpectedResidualOfWhiteNoise) {
  const Eigen::MatrixXd A = design_matrix(grid(), {});
  const Eigen::Index n = A.rows();
  const Eigen::MatrixXd V = 2e-9 * Eigen::MatrixXd::Identity(n, n);
  const auto fit = fit_generalised(A, noisy_voltages(A, 4), V);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(expected_mean_square_V2(A, fit->gain, V),
              2e-9 * static_cast<double>(n - 4) / static_cast<double>(n), 1e-20);
}

}  // namespace
}  // namespace plumbline
