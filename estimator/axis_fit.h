// One axis of the 12-parameter model fitted under its noise: rounding taken out of the means, the
// noise powers estimated beside the parameters, the residual tested.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/residual_test.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/noise/noise_processes.h"
#include "estimator/noise/reml.h"
#include "estimator/pose_means.h"
#include "estimator/quantization/quantized_axis.h"

namespace plumbline {

/// What all axes share.
struct Experiment {
  const CalibrationInput& input;
  const std::vector<PoseMean>& poses;
  const Eigen::MatrixXd& A;   ///< n × 4
  Eigen::MatrixXd drivers;    ///< n × k, temperature and covariates
  PerAxis<double> white_V{};  ///< white noise of one reading; negative when unknown
  PerAxis<double> line_V2{};  ///< VisitLog's, where there is one
  NoiseProcesses processes;
  /// Variance of each mean beyond that of a quiet dwell, where the noise follows something.
  PerAxis<Eigen::VectorXd> noisier_V2;
};

/// One axis on its way through the engine.
struct AxisFit {
  NoiseModel noise;   ///< with the powers that the run, too, supports
  NoiseModel record;  ///< what the static record says about the run
  PooledNoise pooled;
  Eigen::VectorXd y;  ///< pose means freed of rounding, V
  /// To be added to errors of y, and to their mean square, where errors are those of the means as
  /// measured (RoundingFree::beyond_V2).
  Eigen::VectorXd rounding_V;
  double rounding_V2 = 0;
  Eigen::VectorXd known_V2;  ///< of each pose, by positioning and by bursts of noise
  Eigen::VectorXd own_V2;    ///< variance that each pose has for itself: that and rounding
  GeneralisedFit fit;
  Eigen::MatrixXd V;
  ResidualTestResult test;
  bool noise_known = false;
  /// What the poses' codes are worth, where they are better than mean voltages: the estimators then
  /// take these in place of y, the residuals stay those of the mean voltages.
  std::optional<QuantizedAxis> quantized;
};

/// White noise of one reading: within the dwells, or in the record when every pose is read once;
/// negative when nothing tells. V.
double white_noise_V(const CalibrationInput& input, std::size_t axis);

/// `identified`: the noise of the axis as the static record and the dwells have it. Under noise of
/// which nothing is known the residual says how large it is. Precondition: A has rank 4.
AxisFit fit_axis(const Experiment& experiment, const NoiseModel& identified, std::size_t axis);

}  // namespace plumbline
