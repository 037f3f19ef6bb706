// Least squares one observation at a time, by orthogonal rotations of the triangular factor.
#pragma once

#include <Eigen/Core>

#include "estimator/calibrate.h"

namespace plumbline {

/// Keeps the square-root information [R | z], R·x = z, of everything seen so far. Each observation
/// is rotated in by Givens rotations (Golub & Van Loan, section 6.5), so the result after n rows is
/// that of the batch factorisation, never that of accumulated normal equations.
class RecursiveLeastSquares {
 public:
  /// Starts from zero parameters with standard deviation `prior_sd` each: wide enough to leave no
  /// trace, finite so that an estimate exists before the poses determine all four.
  explicit RecursiveLeastSquares(double prior_sd);

  /// One observation b = row·x + e, e of unit variance (whiten or divide by σ first).
  void add(const Eigen::Vector4d& row, double b);

  /// Estimate and covariance (RᵀR)⁻¹ of what has been added.
  AxisEstimate estimate() const;

 private:
  Eigen::Matrix<double, 4, 5> Rz_;  ///< upper triangle R and right-hand side z
};

}  // namespace plumbline
