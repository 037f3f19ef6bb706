#include "estimator/scalar/scalar_noise.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/noise/reml.h"

namespace plumbline {

InnerVariance inner_variance(const std::vector<RestMean>& rests, const ScalarVector& nine) {
  const auto n = std::ssize(rests);
  const Eigen::Matrix3d M = scalar_matrix(nine);
  InnerVariance inner{Eigen::VectorXd(n), {}, 1, 0};
  double white_sum = 0, block_sum = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const RestMean& rest = rests[static_cast<std::size_t>(k)];
    const Eigen::Vector3d seen = M.transpose() * scalar_force_mps2(nine, rest.reading).normalized();
    inner.white(k) = seen.dot(rest.covariance * seen) / static_cast<double>(rest.count);
    if (rest.count / kRestBlocks < 2 || !(inner.white(k) > 0)) continue;
    // Ratios: otherwise one restless interval would decide for all.
    white_sum += 1;
    block_sum += seen.dot(rest.block_covariance * seen) / inner.white(k);
    inner.blocks_dof += static_cast<double>(kRestBlocks - 1);
  }
  if (white_sum > 0) inner.excess = std::max(1.0, block_sum / white_sum);
  // A rest in which nothing flickered is not known without error: it gets what others have.
  const double floor = 1e-3 * inner.white.mean();
  inner.white = inner.white.cwiseMax(floor);
  inner.blocks = inner.excess * inner.white;
  return inner;
}

namespace {

struct Estimate {
  Eigen::VectorXd power;
  double deviance = std::numeric_limits<double>::infinity();
};

Eigen::MatrixXd sum_of(const Eigen::VectorXd& known, const std::vector<Eigen::MatrixXd>& parts,
                       const Eigen::VectorXd& power) {
  Eigen::MatrixXd sum = known.asDiagonal();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (power(static_cast<Eigen::Index>(i)) > 0) {
      sum += power(static_cast<Eigen::Index>(i)) * parts[i];
    }
  }
  return sum;
}

/// Average-information steps, halved until the likelihood rises; powers below zero stay at zero.
Estimate maximise(const Eigen::VectorXd& known, const std::vector<Eigen::MatrixXd>& parts,
                  const Eigen::VectorXd& y, const Eigen::MatrixXd& X, Eigen::VectorXd power) {
  constexpr int kMostSteps = 40;
  const Eigen::Index m = power.size();
  const auto deviance_of = [&](const Projector& projector) {
    return projector.log_determinant + y.dot(projector.P * y);
  };
  Projector projector = make_projector(sum_of(known, parts, power), X);
  Estimate best{power, deviance_of(projector)};
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::VectorXd Py = projector.P * y;
    Eigen::MatrixXd moved(y.size(), m);
    Eigen::VectorXd score(m);
    for (Eigen::Index i = 0; i < m; ++i) {
      const Eigen::MatrixXd& part = parts[static_cast<std::size_t>(i)];
      moved.col(i) = part * Py;
      score(i) = 0.5 * (Py.dot(moved.col(i)) - projector.P.cwiseProduct(part).sum());
    }
    Eigen::MatrixXd information = 0.5 * moved.transpose() * (projector.P * moved);
    for (Eigen::Index i = 0; i < m; ++i) {
      if (best.power(i) > 0 || score(i) > 0) continue;
      // At zero and pushed below: held.
      information.row(i).setZero();
      information.col(i).setZero();
      information(i, i) = 1;
      score(i) = 0;
    }
    const Eigen::VectorXd size = information.diagonal().cwiseSqrt().cwiseMax(1e-300);
    const Eigen::MatrixXd scaled =
        size.cwiseInverse().asDiagonal() * information * size.cwiseInverse().asDiagonal();
    const Eigen::VectorXd change =
        (scaled + 1e-9 * Eigen::MatrixXd::Identity(m, m)).ldlt().solve(score.cwiseQuotient(size));
    double share = 1, gained = 0;
    for (int halving = 0; halving < 10; ++halving, share /= 2) {
      const Eigen::VectorXd next = (best.power + share * change.cwiseQuotient(size)).cwiseMax(0.0);
      const Projector trial = make_projector(sum_of(known, parts, next), X);
      const double deviance = deviance_of(trial);
      if (!(deviance < best.deviance)) continue;
      gained = best.deviance - deviance;
      best = {next, deviance};
      projector = trial;
      break;
    }
    if (gained < 1e-4) break;
  }
  return best;
}

/// Covariance of a bias about its mean over the run, so that the constant bias that is estimated is
/// that mean and not the bias at the start of the walk.
Eigen::MatrixXd about_mean(const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd rows = covariance.rowwise() - covariance.colwise().mean();
  return rows.colwise() - rows.rowwise().mean();
}

}  // namespace

ScalarNoise scalar_noise(const Eigen::VectorXd& inner_variance, const Eigen::VectorXd& residual,
                         const Eigen::MatrixXd& design, const Eigen::MatrixXd& direction,
                         const std::vector<SampleWindow>& windows) {
  constexpr Eigen::Index kFewestForSlowNoise = 10;
  const Eigen::Index n = residual.size();
  ScalarNoise noise;
  if (n <= design.cols()) {
    noise.covariance = inner_variance.asDiagonal();
    return noise;
  }
  const Eigen::MatrixXd X =
      design * design.colwise().norm().cwiseMax(1e-300).cwiseInverse().asDiagonal();
  std::vector<Eigen::MatrixXd> parts;
  parts.emplace_back(Eigen::MatrixXd::Identity(n, n));
  if (n - design.cols() >= kFewestForSlowNoise) {
    const auto unit = unit_covariances(windows, 0);
    const Eigen::MatrixXd seen = direction * direction.transpose();
    parts.push_back(seen.cwiseProduct(about_mean(unit[kTermB])));
    parts.push_back(seen.cwiseProduct(about_mean(unit[kTermK])));
  }
  const double guess = residual.squaredNorm() / static_cast<double>(n);
  Eigen::VectorXd start(std::ssize(parts));
  for (Eigen::Index i = 0; i < start.size(); ++i) {
    start(i) = guess / static_cast<double>(3 * n) *
               parts[static_cast<std::size_t>(i)].diagonal().cwiseInverse().sum();
  }
  const Estimate full = maximise(inner_variance, parts, residual, X, start);
  noise.scatter_gain = std::numeric_limits<double>::infinity();
  noise.scatter_mps2 = std::sqrt(full.power(0));
  if (parts.size() > 1) {
    noise.flicker_mps2 = std::sqrt(full.power(1));
    noise.walk_mps2_per_rt_s = std::sqrt(full.power(2));
    const std::vector<Eigen::MatrixXd> slow(parts.begin() + 1, parts.end());
    const Estimate without = maximise(inner_variance, slow, residual, X, start.tail(2));
    noise.scatter_gain = std::max(0.0, without.deviance - full.deviance);
  }
  noise.covariance = sum_of(inner_variance, parts, full.power);
  return noise;
}

}  // namespace plumbline
