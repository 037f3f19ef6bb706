#include "estimator/noise/powers_allowance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "estimator/noise/powers_posterior.h"

namespace plumbline {

namespace {

/// Probability that there is slow noise at all: the odds by likelihood against a price for what
/// powers that cannot be negative gain by chance.
double probability_of_slow_noise(double gain) {
  constexpr double kPrice = 8;  // of −2 ln L: in white noise the gain exceeds it one time in 60
  return 1 / (1 + std::exp(0.5 * (kPrice - gain)));
}

}  // namespace

PowersAllowance allowance_for_powers(const NoiseProcesses& processes, const EstimatedPowers& powers,
                                     const Eigen::MatrixXd& V, const Eigen::MatrixXd& X,
                                     const Eigen::MatrixXd& C) {
  const Eigen::Index p = C.rows();
  PowersAllowance result{Eigen::MatrixXd::Zero(p, p), Eigen::VectorXd::Zero(p)};
  const Eigen::Index count = powers.power.size();
  if (count == 0) return result;
  const Eigen::LLT<Eigen::MatrixXd> factor(V);
  const Eigen::MatrixXd B = factor.solve(X);
  std::vector<Eigen::MatrixXd> P, Z;  // −∂(X'V⁻¹X) by each power; L⁻¹ times what it does to B
  Eigen::MatrixXd slope(p, count);  // of the diagonal of C
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::MatrixXd moved = processes.unit[static_cast<std::size_t>(i)] * B;
    P.emplace_back(B.transpose() * moved);
    slope.col(i) = (C * P.back() * C).diagonal();
    Z.emplace_back(factor.matrixL().solve(moved));
  }
  const Eigen::MatrixXd& W = powers.covariance;
  const double slow = probability_of_slow_noise(powers.gain_of_slow);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto a = static_cast<std::size_t>(i);
    if (i >= NoiseProcesses::kFirstSlow) result.M -= (1 - slow) * powers.power(i) * P[a];
    for (Eigen::Index j = 0; j < count; ++j) {
      const auto b = static_cast<std::size_t>(j);
      result.M += 2 * slow * W(i, j) * (Z[a].transpose() * Z[b] - P[a] * C * P[b]);
    }
  }
  result.variance = slow * slow * (slope * W).cwiseProduct(slope).rowwise().sum();
  return result;
}

Eigen::MatrixXd with_allowance(const Eigen::MatrixXd& C,
                               const std::vector<PowersAllowance>& allowances) {
  constexpr double kFewest = 3;  // degrees of freedom; of fewer hardly anything is known
  // Of C, more and less: an expansion to second order says nothing beyond.
  constexpr double kMost = 1, kMostLess = 0.9;
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(C.rows(), C.cols());
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(C.rows());
  for (const PowersAllowance& allowance : allowances) {
    M += allowance.M;
    variance += allowance.variance;
  }
  const Eigen::LLT<Eigen::MatrixXd> root(C);
  if (root.info() != Eigen::Success) return C;
  const Eigen::MatrixXd L = root.matrixL();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> relative(L.transpose() * M * L);
  const Eigen::MatrixXd axes = L * relative.eigenvectors();
  const Eigen::MatrixXd allowance =
      axes * relative.eigenvalues().cwiseMin(kMost).cwiseMax(-kMostLess).asDiagonal() *
      axes.transpose();
  const Eigen::VectorXd wider =
      (2 * C.diagonal().array().square() / variance.array().max(1e-300))
          .max(kFewest)
          .unaryExpr([](double dof) { return std::sqrt(dof / (dof - 2)); });
  return wider.asDiagonal() * (C + allowance) * wider.asDiagonal();
}

}  // namespace plumbline
