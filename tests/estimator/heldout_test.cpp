#include "estimator/diagnosis/heldout.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

// Noise that forgets over five visits, beside the noise of the means.
Eigen::MatrixXd slow_covariance_V2(Eigen::Index n) {
  Eigen::MatrixXd covariance_V2(n, n);
  for (Eigen::Index k = 0; k < n; ++k)
    for (Eigen::Index l = 0; l < n; ++l)
      covariance_V2(k, l) = 1e-8 * std::exp(-std::abs(static_cast<double>(k - l)) / 5);
  covariance_V2.diagonal().array() += 5e-9;
  return covariance_V2;
}

TEST(Heldout, IsWhatARefitLeavesAndTheOtherReadingsDoNotForetell) {
  const SyntheticRun data = synthetic_run(3, kSixteenBits, {.k2_x_V_per_g2 = 1e-3});
  const VisitLog log = make_visit_log(data.run, data.description);
  const Observations observed = observe(data.run, log);
  const Eigen::Index n = observed.mean_V[0].size();
  const Eigen::MatrixXd V = slow_covariance_V2(n);
  PoseWhitening whitening;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    whitening.set(i, V);
    whitening.dwell_sd_V[i] = Eigen::VectorXd::Ones(log.dwell_contrasts());
  }
  EnlargedParameters start;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    start.twelve[i] = Eigen::Map<const Eigen::Vector4d>(data.truth[i].data());
  const EnlargedFit fit = fit_enlarged(log, observed, whitening, start);
  ASSERT_TRUE(fit.determined);
  Blocks blocks(4);
  for (Eigen::Index k = 0; k < n; ++k) blocks[static_cast<std::size_t>(k * 4 / n)].push_back(k);
  const std::vector<LeftOut> left =
      Heldout(log, observed.mean_V, whitening).leave_out(fit, {blocks});
  ASSERT_EQ(left.size(), 1U);

  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto row = static_cast<Eigen::Index>(i) * n;
    const Eigen::MatrixXd A =
        prediction_jacobian(log, fit.parameters).block(row, 4 * static_cast<Eigen::Index>(i), n, 4);
    const Eigen::VectorXd& y = observed.mean_V[i];
    double power = 0;
    for (const auto& block : blocks) {
      std::vector<Eigen::Index> rest;
      for (Eigen::Index k = 0; k < n; ++k)
        if (std::find(block.begin(), block.end(), k) == block.end()) rest.push_back(k);
      const Eigen::MatrixXd weight = V(rest, rest).inverse();
      const Eigen::MatrixXd B = A(rest, Eigen::all);
      const Eigen::VectorXd x =
          (B.transpose() * weight * B).ldlt().solve(B.transpose() * weight * y(rest));
      const Eigen::VectorXd error = y(block) - A(block, Eigen::all) * x;
      EXPECT_LT((left[0].residual_V[i](block) - error).norm(), 1e-5 * error.norm());
      const Eigen::MatrixXd by_rest =
          A(block, Eigen::all) * (B.transpose() * weight * B).ldlt().solve(B.transpose() * weight);
      const Eigen::MatrixXd between = by_rest * V(rest, block);
      const Eigen::MatrixXd covariance = V(block, block) - between - between.transpose() +
                                         by_rest * V(rest, rest) * by_rest.transpose();
      const Eigen::VectorXd sd = covariance.diagonal().cwiseSqrt();
      EXPECT_LT((left[0].sd_V[i](block) - sd).norm(), 1e-5 * sd.norm());
      // Given the readings outside the block, its noise has another mean and another covariance.
      const Eigen::MatrixXd from_rest = V(block, rest) * weight;
      const Eigen::VectorXd surprise = error - from_rest * (y(rest) - B * x);
      const Eigen::MatrixXd C = V(block, block) - from_rest * V(rest, block);
      power += surprise.dot(C.ldlt().solve(surprise));
    }
    EXPECT_NEAR(left[0].power[i], power, 1e-4 * power);
  }
}

}  // namespace
}  // namespace plumbline
