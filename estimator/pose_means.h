// One row per pose: what is left of a dwell when only its mean matters.
#pragma once

#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Averages over the samples of one pose.
struct PoseMean {
  Pose pose;
  double t_arrival_s = 0;  ///< time of the first sample
  double t_mean_s = 0;
  double step_s = 0;       ///< mean time between samples; 0 for a single sample
  PerAxis<double> mean_V{};
  PerAxis<double> sd_V{};  ///< standard deviation of one sample; 0 for a single sample
  double temp_C = 0;       ///< NaN when not recorded
};

/// One entry per pose of the set, in the same order. Precondition: every pose has a sample.
std::vector<PoseMean> pose_means(const MeasurementSet& set);

/// Variance of one sample about its pose's mean, pooled over all poses, V². 0 when no pose has two
/// samples.
PerAxis<double> pooled_variance_V2(const std::vector<PoseMean>& poses);

}  // namespace plumbline
