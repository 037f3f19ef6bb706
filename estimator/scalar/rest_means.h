// One row per interval at rest: mean reading, and how well the scatter inside determines it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

struct RestMean {
  Eigen::Vector3d reading = Eigen::Vector3d::Zero();  ///< mean, in the unit of the record
  /// Covariance of a single reading about the mean (3 × 3); zero for a single reading.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// Covariance of the mean from the scatter of block means (eight blocks), which counts what is
  /// alike in neighbouring readings; zero when there are too few readings for blocks.
  Eigen::Matrix3d block_covariance = Eigen::Matrix3d::Zero();
  std::size_t count = 0;
  double t_mean_s = 0;
};

inline constexpr std::size_t kRestBlocks = 8;

/// One entry per pose of the set. Precondition: every pose has a sample.
std::vector<RestMean> rest_means(const MeasurementSet& set);

}  // namespace plumbline
