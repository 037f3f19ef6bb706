// One row per pose: what is left of a dwell when only its mean matters.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Averages over the samples of one pose.
struct PoseMean {
  Pose pose;
  double t_arrival_s = 0;  ///< time of the first sample
  double t_mean_s = 0;
  PerAxis<double> mean_V{};
  PerAxis<double> sd_V{};  ///< standard deviation of one sample; 0 for a single sample
  double temp_C = 0;       ///< NaN when not recorded
};

/// One entry per pose of the set, in the same order. Precondition: every pose has a sample.
std::vector<PoseMean> pose_means(const MeasurementSet& set);

/// The means of one axis as a vector, V.
Eigen::VectorXd mean_voltages(const std::vector<PoseMean>& poses, std::size_t axis);

/// Standard deviation of one reading about its neighbours within the poses, from differences, which
/// slow drifts do not enter, V; 0 when no pose has two samples.
double white_scatter_V(const MeasurementSet& set, std::size_t axis);

}  // namespace plumbline
