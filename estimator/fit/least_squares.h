// Batch least squares by orthogonal factorisation. One implementation serves every linear fit.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace plumbline {

struct LeastSquaresOptions {
  /// A column-scaled design counts as rank deficient below this ratio of pivots.
  double rank_tolerance = 1e-13;
};

/// Result of min |A x − b|. n observations, p parameters.
struct LeastSquaresResult {
  Eigen::VectorXd x;         ///< p; the shortest solution when rank < p
  Eigen::MatrixXd cofactor;  ///< p × p, (AᵀA)⁻¹ from R; empty when rank < p
  Eigen::VectorXd residual;  ///< n, b − A x
  double residual_sum_of_squares = 0;
  Eigen::Index rank = 0;
  Eigen::Index degrees_of_freedom = 0;  ///< n − rank
};

/// Solves with unit column norms and a column-pivoted Householder factorisation, then refines the
/// solution of the augmented system twice with residuals in extended precision (Björck 1967). The
/// normal equations are never formed.
/// Shapes: A n × p with n ≥ 1, p ≥ 1; b n. Rank deficiency is a value of the result, not an error.
LeastSquaresResult solve_least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                       const LeastSquaresOptions& options = {});

/// Turns correlated observations into uncorrelated ones of unit variance: V = L·Lᵀ, rows of L⁻¹·.
/// Because L is lower triangular the first k whitened rows depend on the first k observations only,
/// so the same rows serve a recursive solution.
class Whitening {
 public:
  /// Nothing when V (n × n, symmetric) is not positive definite.
  static std::optional<Whitening> of(const Eigen::MatrixXd& V);

  /// L⁻¹·M, M with n rows.
  Eigen::MatrixXd apply(const Eigen::MatrixXd& M) const;
  /// L⁻ᵀ·M, M with n rows.
  Eigen::MatrixXd apply_transposed(const Eigen::MatrixXd& M) const;

 private:
  explicit Whitening(Eigen::MatrixXd L) : L_(std::move(L)) {}
  Eigen::MatrixXd L_;
};

}  // namespace plumbline
