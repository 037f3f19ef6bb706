// Closes the loop: what the diagnosis finds joins the model, and the calibration is done again.
#pragma once

#include <optional>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/diagnosis/noise_drivers.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/reml.h"
#include "estimator/pose_means.h"

namespace plumbline {

struct ExplainInput {
  const CalibrationInput& input;
  const VisitLog& log;
  const std::vector<NoiseDriver>& noise_follows;
  const std::vector<PoseMean>& poses;
  const std::vector<SampleWindow>& windows;
  const PerAxis<NoiseModel>& noise;   ///< as identified
  PerAxis<Eigen::VectorXd> known_V2;  ///< variance of each pose by the head's positioning
  const NoiseProcesses& processes;    ///< of the windows
  PerAxis<PooledNoise> pooled;        ///< of the pose means beside the 12 parameters
};

/// The largest error on left-out poses after effects were added.
struct WorstError {
  double error_mps2 = 0;
  double u_mps2 = 0;
};

/// Searches the residual of a finished 12-parameter calibration. When effects are found and lower
/// the error on left-out poses, fills diagnosis, final, after, floor and residual_after of `result`
/// and returns the worst error; otherwise leaves `result` as it is.
std::optional<WorstError> explain(const ExplainInput& input, const CalibrationOptions& options,
                                  Calibration& result);

}  // namespace plumbline
