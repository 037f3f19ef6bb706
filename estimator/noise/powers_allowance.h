// What it adds to the uncertainty of estimates that the powers of the noise are estimates, too.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/reml.h"

namespace plumbline {

/// What one record adds to the knowledge that the powers of its noise are estimates. p parameters.
struct PowersAllowance {
  Eigen::MatrixXd M;         ///< p×p: the covariance C becomes C + C·M·C
  Eigen::VectorXd variance;  ///< p, of the diagonal of C
};
/// Of generalised least-squares estimates of the design X (n×p) with covariance C under noise of
/// covariance V. M holds the scatter of the weights (Kenward & Roger, Biometrics 53, 1997, eq. 5)
/// and takes off slow noise as far as it may not be there at all: powers cannot be negative, so
/// estimates of none are too large as often as not.
PowersAllowance allowance_for_powers(const NoiseProcesses& processes, const EstimatedPowers& powers,
                                     const Eigen::MatrixXd& V, const Eigen::MatrixXd& X,
                                     const Eigen::MatrixXd& C);
/// C with the allowances of all records, whose noise is independent, at most doubled by them, and
/// every standard uncertainty with that of Student's t for its degrees of freedom ν = 2·C²/var C,
/// by √(ν/(ν − 2)) (Satterthwaite; JCGM 101:2008, 6.4.9.4).
Eigen::MatrixXd with_allowance(const Eigen::MatrixXd& C,
                               const std::vector<PowersAllowance>& allowances);

}  // namespace plumbline
