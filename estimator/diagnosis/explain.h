// Closes the loop: what the diagnosis finds joins the model, and the calibration is done again.
#pragma once

#include <optional>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/diagnosis/noise_drivers.h"
#include "estimator/error_figures.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/reml.h"
#include "estimator/pose_means.h"
#include "estimator/uncertainty/monte_carlo.h"

namespace plumbline {

struct ExplainInput {
  const CalibrationInput& input;
  const VisitLog& log;
  const std::vector<NoiseDriver>& noise_follows;
  const std::vector<PoseMean>& poses;
  const std::vector<SampleWindow>& windows;
  const PerAxis<NoiseModel>& noise;  ///< as identified
  PerAxis<Eigen::VectorXd>
      known_V2;  ///< variance of each pose by positioning and by noise of its own
  const NoiseProcesses& processes;  ///< of the windows
  PerAxis<PooledNoise> pooled;      ///< of the pose means beside the 12 parameters
};

/// What comes of a calibration after effects were added.
struct Explained {
  WorstError worst;             ///< on left-out poses
  PropagatedEstimate estimate;  ///< the twelve of the enlarged model
};

/// Searches the residual of a finished 12-parameter calibration. When effects are found and lower
/// the error on left-out poses, fills diagnosis, final, after, floor and residual_after of `result`
/// and says what else came of it. Otherwise `result` gets what the search tells beside: Schwarz's
/// criterion, limits of what was not found, and what the noise follows.
std::optional<Explained> explain(const ExplainInput& input, const CalibrationOptions& options,
                                 Calibration& result);

}  // namespace plumbline
