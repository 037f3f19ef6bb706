// The 12-parameter model fitted to one axis under correlated noise, and what follows from the fit
// in closed form: expected residuals and residuals of poses left out.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/pose_means.h"

namespace plumbline {

/// Rows [a_x a_y a_z 1], one per pose, a in standard g; γ from the local gravity.
Eigen::MatrixXd design_matrix(const std::vector<PoseMean>& poses, const Gravity& gravity);

/// Rank and condition of the column-scaled design by singular values, and in words what the poses
/// do not determine. Precondition: at least one pose.
Observability observability(const Eigen::MatrixXd& design);

/// One axis. n poses.
struct GeneralisedFit {
  AxisEstimate estimate;                   ///< covariance from the given V alone
  Eigen::VectorXd residual_V;              ///< n, measured − fitted
  Eigen::MatrixXd residual_covariance_V2;  ///< n × n, V − A·C·Aᵀ: what V alone leaves after the fit
  Eigen::MatrixXd gain;                    ///< 4 × n, estimate = gain·y
  Eigen::MatrixXd whitened;  ///< n × 5, L⁻¹·[A y] with V = L·Lᵀ, for the recursive form
  Eigen::VectorXd whitened_residual;  ///< n, L⁻¹·residual
};

/// Generalised least squares (Aitken): whitening by Cholesky, then solve_least_squares. Nothing
/// when V is not positive definite. Preconditions: A is n × 4 of rank 4, y n, V n × n.
std::optional<GeneralisedFit> fit_generalised(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                              const Eigen::MatrixXd& V);

/// Residuals of poses against fits to others, each with its standard deviation under V.
struct HeldoutResiduals {
  Eigen::VectorXd residual_V;  ///< n
  Eigen::VectorXd sd_V;        ///< n, √diag of the covariance of y_B − A_B·x_{−B}
};

/// Residuals y_B − A_B·x_{−B} of the poses in `block` against the fit to all others, without
/// refitting: poses given a free parameter each are poses left out. One per pose, for blocks that
/// together leave out every pose at most once; poses of a block without which the rest no longer
/// determines the parameters, and poses in no block, are NaN.
HeldoutResiduals heldout_residuals(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                   const Eigen::MatrixXd& V,
                                   const std::vector<std::vector<Eigen::Index>>& blocks);

}  // namespace plumbline
