// One pass of the engine, from the means of a run to its certified model, in noise of a given kind.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/noise_processes.h"
#include "estimator/pose_means.h"

namespace plumbline {

/// What a run is, whatever is then taken for its noise.
struct PreparedRun {
  const CalibrationInput& input;  ///< with the converter's offset as the codes show it
  std::vector<PoseMean> poses;
  std::vector<SampleWindow> windows;  ///< of the poses
  Eigen::MatrixXd A;                  ///< n × 4, what the means are modelled by
  PerAxis<NoiseModel> noise;          ///< as identified
};

/// Everything that calibrate() does once it is known what the noise may hold. Deterministic.
Calibration calibrate_in_noise(const FurtherNoise& further, const PreparedRun& run,
                               const CalibrationOptions& options);

}  // namespace plumbline
