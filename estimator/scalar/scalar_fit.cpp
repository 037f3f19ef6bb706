#include "estimator/scalar/scalar_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "estimator/fit/least_squares.h"

namespace plumbline {
namespace {

constexpr const char* kName[kScalarCount] = {"bias x",   "bias y",   "bias z",
                                             "scale x",  "scale y",  "scale z",
                                             "angle yz", "angle zy", "angle zx"};

/// Condition by singular values of unit columns, and the names in the weakest direction.
void judge(ScalarFit& fit) {
  const Eigen::VectorXd norms = fit.whitened_jacobian.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = fit.whitened_jacobian * norms.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinV);
  const Eigen::VectorXd s = svd.singularValues();
  fit.condition = s(0) / std::max(s(s.size() - 1), 1e-300);
  const Eigen::VectorXd weakest = svd.matrixV().col(s.size() - 1);
  for (Eigen::Index j = 0; j < kScalarCount; ++j) {
    if (std::abs(weakest(j)) < 0.3) continue;
    fit.weakest += (fit.weakest.empty() ? "" : ", ") + std::string(kName[j]);
  }
}

}  // namespace

std::optional<ScalarVector> ellipsoid_start(const std::vector<Eigen::Vector3d>& reading,
                                            double local_mps2) {
  Eigen::Vector3d low = reading.front(), high = low;
  for (const Eigen::Vector3d& m : reading) {
    low = low.cwiseMin(m);
    high = high.cwiseMax(m);
  }
  const Eigen::Vector3d centre = (low + high) / 2;
  const Eigen::Vector3d half = (high - low) / 2;
  if (!(half.minCoeff() > 0)) return std::nullopt;

  const auto n = std::ssize(reading);
  Eigen::MatrixXd design(n, kScalarCount);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Vector3d q = (reading[static_cast<std::size_t>(k)] - centre).cwiseQuotient(half);
    design.row(k) << q.x() * q.x(), q.y() * q.y(), q.z() * q.z(), 2 * q.x() * q.y(),
        2 * q.x() * q.z(), 2 * q.y() * q.z(), 2 * q.x(), 2 * q.y(), 2 * q.z();
  }
  const LeastSquaresResult solved =
      solve_least_squares(design, Eigen::VectorXd::Ones(n), {.rank_tolerance = 1e-9});
  if (solved.rank < kScalarCount) return std::nullopt;
  const Eigen::VectorXd& x = solved.x;
  Eigen::Matrix3d A;
  A << x(0), x(3), x(4), x(3), x(1), x(5), x(4), x(5), x(2);
  const Eigen::Vector3d middle = -A.fullPivLu().solve(x.tail<3>());
  const double level = 1 + middle.dot(A * middle);
  if (!middle.allFinite() || !(level > 0)) return std::nullopt;
  const Eigen::LLT<Eigen::Matrix3d> llt(A * (local_mps2 * local_mps2 / level));
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Eigen::Matrix3d M = Eigen::Matrix3d(llt.matrixU()) * half.cwiseInverse().asDiagonal();
  ScalarVector nine;
  nine << centre + half.cwiseProduct(middle), M.diagonal(), -M(0, 1) / M(1, 1), M(0, 2) / M(2, 2),
      -M(1, 2) / M(2, 2);
  if (!nine.allFinite()) return std::nullopt;
  return nine;
}

ScalarFit fit_scalar(ScalarData& data, const ScalarParameters& start,
                     const Eigen::MatrixXd& covariance) {
  constexpr int kMostSteps = 60;
  const auto whitening = Whitening::of(covariance);
  ScalarFit fit;
  fit.parameters = start;
  const auto evaluate = [&](const ScalarParameters& parameters) {
    set_attitudes(data, parameters.nine);
    return scalar_residual_mps2(data, parameters);
  };
  fit.residual_mps2 = evaluate(fit.parameters);
  double chi2 = whitening->apply(fit.residual_mps2).squaredNorm();
  for (int step = 0; step < kMostSteps && !fit.converged; ++step) {
    const Eigen::MatrixXd jacobian = whitening->apply(scalar_jacobian(data, fit.parameters));
    const Eigen::VectorXd right = whitening->apply(fit.residual_mps2);
    const LeastSquaresResult solved = solve_least_squares(jacobian, -right);
    double share = 1;
    bool better = false;
    for (int halving = 0; halving < 12; ++halving, share /= 2) {
      ScalarParameters moved = fit.parameters;
      moved.set_free_values(fit.parameters.free_values() + share * solved.x);
      if (!(moved.nine.segment<3>(3).minCoeff() > 0)) continue;
      const Eigen::VectorXd residual = evaluate(moved);
      const double moved_chi2 = whitening->apply(residual).squaredNorm();
      if (!(moved_chi2 <= chi2 * (1 + 1e-12))) continue;
      better = true;
      fit.converged = chi2 - moved_chi2 < 1e-9 * (1 + moved_chi2);
      fit.parameters = std::move(moved);
      fit.residual_mps2 = residual;
      chi2 = moved_chi2;
      break;
    }
    if (!better) fit.converged = true;  // no step lowers it: this is the minimum to rounding
  }
  fit.residual_mps2 = evaluate(fit.parameters);
  fit.jacobian = scalar_jacobian(data, fit.parameters);
  fit.whitened_jacobian = whitening->apply(fit.jacobian);
  fit.whitened_residual = whitening->apply(fit.residual_mps2);
  judge(fit);
  fit.covariance = solve_least_squares(fit.whitened_jacobian, fit.whitened_residual).cofactor;
  return fit;
}

}  // namespace plumbline
