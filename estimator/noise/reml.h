// The noise powers of a run, learned from a static record and from the run's own residuals.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/covariance.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// Result of pooling.
struct PooledNoise {
  NoisePowers power = NoisePowers::Zero();                  ///< [Q² N² B² K² R²]
  NoisePowerMatrix information = NoisePowerMatrix::Zero();  ///< of both sources about them
  Eigen::MatrixXd covariance;  ///< n×n of the window means with these powers
  bool converged = false;
};

/// Restricted maximum likelihood (Patterson & Thompson, 1971) of the noise powers given window
/// means y = design·β + noise, β free, with the information of the static record as a Gaussian
/// prior. mean: n; design: n×p of full rank, n > p; extra_variance: n further known variances
/// (positioning, say), or empty.
/// White noise and quantization stay as the record says; the slow terms, which a record shorter
/// than the run barely determines, move.
PooledNoise pool_noise(const NoiseModel& model, const std::vector<SampleWindow>& windows,
                       const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                       const Eigen::VectorXd& extra_variance);

}  // namespace plumbline
