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

/// Dwells that are clearly noisier than most, as when somebody walks past: variance that their
/// means have beyond that of the others, V², zero for all others. Told by the typical difference of
/// neighbouring readings, which neither a course within the dwell nor a single jump changes.
/// Nothing where a dwell has fewer than 16 readings or the noise stays within `step_V`, between
/// the codes.
Eigen::VectorXd burst_variance_V2(const MeasurementSet& set, std::size_t axis, double step_V);

}  // namespace plumbline
