// How large the errors are that a calibrated axis leaves, and how large noise alone would make
// them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/pose_means.h"

namespace plumbline {

/// m/s² per volt of residual: g_n / K_ii, signed. NaN for an axis that does not respond.
double input_referred_mps2_per_V(const AxisEstimate& estimate, std::size_t axis);

/// Root mean square of the finite entries; NaN when there is none.
double rms(const Eigen::VectorXd& values);
/// Largest magnitude of the finite entries; NaN when there is none.
double max_abs(const Eigen::VectorXd& values);

/// Errors of an axis on poses that were left out of the fit, in blocks of time, then of position:
/// 2n each, NaN where nothing is known.
struct LeftOutErrors {
  Eigen::VectorXd error_mps2;
  Eigen::VectorXd u_mps2;  ///< standard uncertainty, by the noise and by the fit to the others
};

/// The largest of all, which conformity is decided by.
struct WorstError {
  double error_mps2 = -1;  ///< magnitude; negative: there is none
  double u_mps2 = 0;
};
WorstError worst_of(const PerAxis<LeftOutErrors>& errors);

/// Poses (row numbers, ascending) that are left out together; each partition covers every pose
/// once.
using Blocks = std::vector<std::vector<Eigen::Index>>;

/// Ten stretches of the visiting order: what drifts must be predicted, not interpolated.
Blocks time_blocks(const std::vector<PoseMean>& poses);
/// Cells of 60° in δ by 30° in h: what depends on position must be predicted from elsewhere.
Blocks position_blocks(const std::vector<PoseMean>& poses);

/// Root mean square over all samples of one axis of voltage − predicted mean of their pose, V.
/// predicted_V: one per pose.
double sample_rms_V(const MeasurementSet& set, const Eigen::VectorXd& predicted_V,
                    std::size_t axis);

/// Root mean square residual of n poses that a covariance V of the pose means leaves after the fit
/// with the given gain (4 × n): √(trace(P·V·Pᵀ)/n), P = I − A·gain. V².
double expected_mean_square_V2(const Eigen::MatrixXd& A, const Eigen::MatrixXd& gain,
                               const Eigen::MatrixXd& V);

/// How far chance takes the root mean square of one run's residuals from the expected one, to first
/// order: slow noise has few degrees of freedom. S: n × n, what the noise leaves after the fit, V²;
/// V: ‖S‖/√(2·n·trace(S)), Gaussian residuals.
double scatter_of_rms_V(const Eigen::MatrixXd& S);

}  // namespace plumbline
