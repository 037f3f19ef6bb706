// The nine parameters (and effects) of the angle-free model by weighted least squares.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "estimator/scalar/scalar_model.h"

namespace plumbline {

/// Nine parameters from the ellipsoid that the readings lie on, without a start: the linear
/// least-squares solution of x'Ax + 2v'x = 1. Nothing when that is no ellipsoid, which happens
/// when the attitudes do not determine it. Precondition: at least nine readings.
std::optional<ScalarVector> ellipsoid_start(const std::vector<Eigen::Vector3d>& reading,
                                            double local_mps2);

struct ScalarFit {
  ScalarParameters parameters;
  Eigen::MatrixXd covariance;         ///< of the free parameters
  Eigen::VectorXd residual_mps2;      ///< n, |a| − g
  Eigen::MatrixXd jacobian;           ///< n × free
  Eigen::VectorXd whitened_residual;  ///< n
  Eigen::MatrixXd whitened_jacobian;  ///< n × free
  double condition = 0;               ///< of the column-scaled whitened Jacobian
  std::string weakest;  ///< the parameters that make up its least determined direction
  bool converged = false;
};

/// Gauss–Newton with orthogonal factorisation and step halving. `covariance` (n × n) of the
/// residuals must be positive definite. Attitudes of data.log follow the estimate.
ScalarFit fit_scalar(ScalarData& data, const ScalarParameters& start,
                     const Eigen::MatrixXd& covariance);

}  // namespace plumbline
