#include "estimator/scalar/rest_means.h"

#include <cassert>

namespace plumbline {
namespace {

Eigen::Vector3d reading_at(const SampleTable& samples, std::size_t row) {
  return {samples.u_V[0][row], samples.u_V[1][row], samples.u_V[2][row]};
}

Eigen::Vector3d mean_of(const SampleTable& samples, std::size_t first, std::size_t count) {
  const Eigen::Vector3d origin = reading_at(samples, first);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t row = first; row < first + count; ++row) {
    sum += reading_at(samples, row) - origin;
  }
  return origin + sum / static_cast<double>(count);
}

}  // namespace

std::vector<RestMean> rest_means(const MeasurementSet& set) {
  std::vector<RestMean> means;
  means.reserve(set.poses.size());
  for (const Pose& pose : set.poses) {
    assert(pose.count > 0);
    RestMean mean;
    mean.count = pose.count;
    mean.reading = mean_of(set.samples, pose.first, pose.count);
    for (std::size_t row = pose.first; row < pose.first + pose.count; ++row) {
      const Eigen::Vector3d d = reading_at(set.samples, row) - mean.reading;
      mean.covariance += d * d.transpose();
      mean.t_mean_s += set.samples.t_s[row] / static_cast<double>(pose.count);
    }
    if (pose.count > 1) mean.covariance /= static_cast<double>(pose.count - 1);
    const std::size_t length = pose.count / kRestBlocks;
    if (length >= 2) {
      const Eigen::Vector3d middle = mean_of(set.samples, pose.first, length * kRestBlocks);
      for (std::size_t block = 0; block < kRestBlocks; ++block) {
        const Eigen::Vector3d d =
            mean_of(set.samples, pose.first + block * length, length) - middle;
        mean.block_covariance += d * d.transpose();
      }
      mean.block_covariance /= static_cast<double>(kRestBlocks * (kRestBlocks - 1));
    }
    means.push_back(mean);
  }
  return means;
}

}  // namespace plumbline
