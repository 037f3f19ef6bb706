// How uncertain the magnitude of each rest is: scatter inside it, and what comes from rest to rest.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/covariance.h"
#include "estimator/scalar/rest_means.h"
#include "estimator/scalar/scalar_model.h"

namespace plumbline {

/// Variance of |a| of each rest from the scatter inside it, (m/s²)².
struct InnerVariance {
  Eigen::VectorXd white;   ///< as if readings were independent: s²/n
  Eigen::VectorXd blocks;  ///< white × what the block means of all rests show in excess
  double excess = 1;       ///< that factor, ≥ 1
  double blocks_dof = 0;   ///< degrees of freedom behind it; 0 when no rest has enough readings
};
InnerVariance inner_variance(const std::vector<RestMean>& rests, const ScalarVector& nine);

/// Variance components of the residual from rest to rest, by restricted maximum likelihood.
struct ScalarNoise {
  double scatter_mps2 = 0;        ///< independent from rest to rest
  double flicker_mps2 = 0;        ///< of each axis's bias, coefficient B
  double walk_mps2_per_rt_s = 0;  ///< of each axis's bias, coefficient K
  /// 2·ln likelihood that is lost without the independent scatter.
  double scatter_gain = 0;
  Eigen::MatrixXd covariance;  ///< n × n of the residuals, (m/s²)²
};

/// residual and design (n × p: what the model takes up) at the estimate, direction n × 3: unit
/// vectors of the specific force. With too few rests (n − p < 10) only the independent scatter.
ScalarNoise scalar_noise(const Eigen::VectorXd& inner_variance, const Eigen::VectorXd& residual,
                         const Eigen::MatrixXd& design, const Eigen::MatrixXd& direction,
                         const std::vector<SampleWindow>& windows);

}  // namespace plumbline
