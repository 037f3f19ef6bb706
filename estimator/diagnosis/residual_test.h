// Is there anything in the residual of the pose means that the noise does not explain?
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/noise_model.h"
#include "estimator/noise/reml.h"

namespace plumbline {

/// One axis, n poses in visiting order.
struct ResidualTestInput {
  const Eigen::VectorXd& mean;            ///< n pose means, V
  const Eigen::MatrixXd& design;          ///< n×p columns of the model under test, full rank
  const Eigen::MatrixXd& specific_force;  ///< n×3, g: what the position-dependent tests use
  const NoiseProcesses& processes;        ///< at the n windows
  const Eigen::VectorXd& extra_variance;  ///< n known variances (positioning), V², or empty
  /// n×k means of further recorded quantities (temperature, humidity …), any unit; may be empty.
  Eigen::MatrixXd drivers = {};
  /// The means were freed of coarse rounding: single ones stray further than Gaussian noise does.
  bool coarse = false;
};

/// Degrees of freedom of Student's t that stands for the tails of single such means.
inline constexpr double kDofOfCoarseReadings = 6;

struct ResidualTestResult {
  double chi2 = 0;         ///< whitened sum of squares r'Σ⁻¹r
  double dof = 0;          ///< n − p
  double p_value = 1;      ///< of the combined test
  double p_structure = 1;  ///< functions of position, way to the pose and drivers
  double p_excess = 1;     ///< more scatter from pose to pose than the noise allows
  double p_outlier = 1;    ///< the most deviating single pose
  PooledNoise noise;       ///< noise powers under "no effect", and the Σ that was used
  EstimatedPowers powers;  ///< what is known of those
};

/// Pose means of temperature and covariates, n×k, for ResidualTestInput::drivers; a quantity that
/// is not recorded throughout is left out.
Eigen::MatrixXd driver_means(const SampleTable& samples, const std::vector<Pose>& poses);

/// Tests "the model plus the identified noise is all there is".
///
/// The slow noise terms, uncertain in a static record shorter than the run, are re-estimated from
/// record and run together (reml.h), twice: from all that the model leaves, and from what broad
/// structure functions (monomials of the specific force up to degree 4, the way from the previous
/// pose, scale drift, the drivers) leave besides. p_structure merges the two F values of
/// these functions, with the freedom in which the noise is known; p_excess and p_outlier judge what
/// is left. Fewer than p + 3 × functions poses leave p_structure at 1. Slow drift that none of the
/// functions describes is taken for noise: it cannot be told from flicker and random walk. The
/// three are combined by Bonferroni.
ResidualTestResult test_residual(const NoiseModel& noise, const ResidualTestInput& input);

}  // namespace plumbline
