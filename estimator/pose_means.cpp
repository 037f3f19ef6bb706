#include "estimator/pose_means.h"

#include <cassert>
#include <cmath>
#include <limits>
#include <span>

namespace plumbline {
namespace {

struct Moments {
  double mean = 0;
  double sd = 0;
};

// Differences from the first value keep all digits when the spread is small against the level.
Moments moments(std::span<const double> values) {
  const auto n = static_cast<double>(values.size());
  double sum = 0;
  for (const double value : values) sum += value - values.front();
  const double offset = sum / n;
  double squares = 0;
  for (const double value : values) {
    const double deviation = (value - values.front()) - offset;
    squares += deviation * deviation;
  }
  return {values.front() + offset, values.size() > 1 ? std::sqrt(squares / (n - 1)) : 0.0};
}

}  // namespace

std::vector<PoseMean> pose_means(const MeasurementSet& set) {
  const SampleTable& samples = set.samples;
  std::vector<PoseMean> result;
  result.reserve(set.poses.size());
  for (const Pose& pose : set.poses) {
    assert(pose.count > 0 && pose.first + pose.count <= samples.size());
    const auto window = [&](const std::vector<double>& column) {
      return std::span<const double>(column).subspan(pose.first, pose.count);
    };
    PoseMean mean;
    mean.pose = pose;
    const std::span<const double> t_s = window(samples.t_s);
    mean.t_arrival_s = t_s.front();
    mean.t_mean_s = moments(t_s).mean;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const Moments voltage = moments(window(samples.u_V[axis]));
      mean.mean_V[axis] = voltage.mean;
      mean.sd_V[axis] = voltage.sd;
    }
    mean.temp_C = samples.temp_C.empty() ? std::numeric_limits<double>::quiet_NaN()
                                         : moments(window(samples.temp_C)).mean;
    result.push_back(mean);
  }
  return result;
}

Eigen::VectorXd mean_voltages(const std::vector<PoseMean>& poses, std::size_t axis) {
  Eigen::VectorXd result(static_cast<Eigen::Index>(poses.size()));
  for (std::size_t row = 0; row < poses.size(); ++row)
    result(static_cast<Eigen::Index>(row)) = poses[row].mean_V[axis];
  return result;
}

double white_scatter_V(const MeasurementSet& set, std::size_t axis) {
  const std::vector<double>& u_V = set.samples.u_V[axis];
  double sum = 0;
  std::size_t count = 0;
  for (const Pose& pose : set.poses) {
    for (std::size_t k = pose.first + 1; k < pose.first + pose.count; ++k) {
      sum += (u_V[k] - u_V[k - 1]) * (u_V[k] - u_V[k - 1]);
      ++count;
    }
  }
  return count == 0 ? 0 : std::sqrt(sum / (2 * static_cast<double>(count)));
}

}  // namespace plumbline
