#include "estimator/fit/least_squares.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cassert>

namespace plumbline {
namespace {

using ExtendedMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;
using Factorisation = Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;

/// Full-rank solution with R, then two corrections of [I A; Aᵀ 0]·[r; x] = [b; 0].
struct Refined {
  Eigen::VectorXd x;
  Eigen::VectorXd residual;
};

Refined solve_refined(const Eigen::MatrixXd& A, const Eigen::VectorXd& b, const Factorisation& qr) {
  const Eigen::Index p = A.cols();
  const ExtendedMatrix A_ext = A.cast<long double>();
  const ExtendedVector b_ext = b.cast<long double>();
  const Eigen::MatrixXd R = qr.matrixR().topLeftCorner(p, p);

  ExtendedVector x = qr.solve(b).cast<long double>();
  ExtendedVector r = b_ext - A_ext * x;
  for (int pass = 0; pass < 2; ++pass) {
    const Eigen::VectorXd f = (b_ext - r - A_ext * x).cast<double>();
    const Eigen::VectorXd g = (-(A_ext.transpose() * r)).cast<double>();
    const Eigen::VectorXd h =
        R.transpose().triangularView<Eigen::Lower>().solve(qr.colsPermutation().transpose() * g);
    Eigen::VectorXd d = qr.householderQ().adjoint() * f;
    const Eigen::VectorXd dx = R.triangularView<Eigen::Upper>().solve(d.head(p) - h);
    d.head(p) = h;
    const Eigen::VectorXd dr = qr.householderQ() * d;
    x += (qr.colsPermutation() * dx).cast<long double>();
    r += dr.cast<long double>();
  }
  return {x.cast<double>(), r.cast<double>()};
}

}  // namespace

LeastSquaresResult solve_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                       const LeastSquaresOptions& options) {
  assert(A.rows() == b.size() && A.rows() > 0 && A.cols() > 0);
  const Eigen::Index p = A.cols();
  Eigen::VectorXd scale = A.colwise().norm();
  for (double& s : scale)
    if (s == 0) s = 1;
  const Eigen::MatrixXd scaled = A * scale.cwiseInverse().asDiagonal();

  Factorisation qr(scaled.rows(), scaled.cols());
  qr.setThreshold(options.rank_tolerance);
  qr.compute(scaled);

  LeastSquaresResult result;
  result.rank = qr.rank();
  result.degrees_of_freedom = A.rows() - result.rank;
  if (result.rank == p) {
    const Refined refined = solve_refined(scaled, b, qr);
    result.x = refined.x.cwiseQuotient(scale);
    result.residual = refined.residual;
    // (AᵀA)⁻¹ = S·P·R⁻¹·R⁻ᵀ·Pᵀ·S with S the inverse column norms.
    const Eigen::MatrixXd R_inverse =
        qr.matrixR().topLeftCorner(p, p).triangularView<Eigen::Upper>().solve(
            Eigen::MatrixXd::Identity(p, p));
    const Eigen::MatrixXd root =
        scale.cwiseInverse().asDiagonal() * (qr.colsPermutation() * R_inverse);
    result.cofactor = root * root.transpose();
  } else {
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> complete(scaled.rows(), scaled.cols());
    complete.setThreshold(options.rank_tolerance);
    complete.compute(scaled);
    result.x = complete.solve(b).cwiseQuotient(scale);
    result.residual = b - A * result.x;
  }
  result.residual_sum_of_squares = result.residual.squaredNorm();
  return result;
}

std::optional<Whitening> Whitening::of(const Eigen::MatrixXd& V) {
  const Eigen::LLT<Eigen::MatrixXd> cholesky(V);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  return Whitening(cholesky.matrixL());
}

Eigen::MatrixXd Whitening::apply(const Eigen::MatrixXd& M) const {
  return L_.triangularView<Eigen::Lower>().solve(M);
}

Eigen::MatrixXd Whitening::apply_transposed(const Eigen::MatrixXd& M) const {
  return L_.transpose().triangularView<Eigen::Upper>().solve(M);
}

}  // namespace plumbline
