#include "estimator/fit/recursive_least_squares.h"

#include <Eigen/Jacobi>
#include <cassert>

namespace plumbline {

RecursiveLeastSquares::RecursiveLeastSquares(double prior_sd) {
  assert(prior_sd > 0);
  Rz_.setZero();
  Rz_.leftCols<4>().diagonal().setConstant(1.0 / prior_sd);
}

void RecursiveLeastSquares::add(const Eigen::Vector4d& row, double b) {
  Eigen::Matrix<double, 2, 5> pair;
  pair.row(1) << row.transpose(), b;
  for (Eigen::Index k = 0; k < 4; ++k) {
    pair.row(0) = Rz_.row(k);
    Eigen::JacobiRotation<double> rotation;
    rotation.makeGivens(pair(0, k), pair(1, k));
    pair.applyOnTheLeft(0, 1, rotation.adjoint());
    Rz_.row(k) = pair.row(0);
  }
}

AxisEstimate RecursiveLeastSquares::estimate() const {
  const Eigen::Matrix4d R = Rz_.leftCols<4>();
  const Eigen::Matrix4d R_inverse =
      R.triangularView<Eigen::Upper>().solve(Eigen::Matrix4d::Identity());
  return {R.triangularView<Eigen::Upper>().solve(Rz_.col(4)), R_inverse * R_inverse.transpose()};
}

}  // namespace plumbline
