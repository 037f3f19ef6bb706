// Is there anything in the residual of the pose means that the noise does not explain?
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/covariance.h"
#include "estimator/noise/noise_model.h"
#include "estimator/noise/reml.h"

namespace plumbline {

/// One axis, n poses in visiting order.
struct ResidualTestInput {
  const Eigen::VectorXd& mean;               ///< n pose means, V
  const Eigen::MatrixXd& design;             ///< n×p columns of the model under test, full rank
  const Eigen::MatrixXd& specific_force;     ///< n×3, g: what the position-dependent tests use
  const std::vector<SampleWindow>& windows;  ///< n
  const Eigen::VectorXd& extra_variance;     ///< n known variances (positioning), V², or empty
};

struct ResidualTestResult {
  double chi2 = 0;         ///< whitened sum of squares r'Σ⁻¹r
  double dof = 0;          ///< n − p
  double p_value = 1;      ///< of the combined test
  double p_structure = 1;  ///< smooth functions of the position
  double p_excess = 1;     ///< more scatter from pose to pose than the noise allows
  double p_outlier = 1;    ///< the most deviating single pose
  PooledNoise noise;       ///< noise powers under "no effect", and the Σ that was used
};

/// Tests "the model plus the identified noise is all there is". The slow noise terms, uncertain in
/// a short static record, are re-estimated together with the run under that hypothesis first.
/// The partial tests are combined by Bonferroni, so p_value is conservative.
ResidualTestResult test_residual(const NoiseModel& noise, const ResidualTestInput& input);

}  // namespace plumbline
