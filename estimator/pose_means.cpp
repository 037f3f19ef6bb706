#include "estimator/pose_means.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "estimator/median.h"

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

namespace {

/// Of the differences of neighbouring readings within a pose.
struct Differences {
  double mean_square_V2 = 0;
  double typical_V = 0;  ///< mean size of the smaller three quarters
};
Differences differences_of(const std::vector<double>& u_V, const Pose& pose) {
  std::vector<double> size_V;
  Differences found;
  for (std::size_t k = pose.first + 1; k < pose.first + pose.count; ++k) {
    size_V.push_back(std::abs(u_V[k] - u_V[k - 1]));
    found.mean_square_V2 += size_V.back() * size_V.back();
  }
  found.mean_square_V2 /= static_cast<double>(size_V.size());
  const auto smaller = size_V.begin() + 3 * std::ssize(size_V) / 4;
  std::nth_element(size_V.begin(), smaller, size_V.end());
  found.typical_V =
      std::accumulate(size_V.begin(), smaller, 0.0) / static_cast<double>(smaller - size_V.begin());
  return found;
}

}  // namespace

Eigen::VectorXd burst_variance_V2(const MeasurementSet& set, std::size_t axis, double step_V) {
  constexpr std::size_t kFewestReadings = 16;
  constexpr double kSeen = 0.6;  // of a step, below which codes hide noise
  const auto n = std::ssize(set.poses);
  Eigen::VectorXd variance_V2 = Eigen::VectorXd::Zero(n);
  const auto is_short = [](const Pose& pose) { return pose.count < kFewestReadings; };
  if (n == 0 || std::any_of(set.poses.begin(), set.poses.end(), is_short)) return variance_V2;
  std::vector<Differences> dwells;
  for (const Pose& pose : set.poses) dwells.push_back(differences_of(set.samples.u_V[axis], pose));
  const auto usual = [&](double Differences::*value) {
    std::vector<double> values;
    values.reserve(dwells.size());
    for (const Differences& dwell : dwells) values.push_back(dwell.*value);
    return median(std::move(values));
  };
  const double usual_V = usual(&Differences::typical_V);
  const double usual_V2 = usual(&Differences::mean_square_V2);
  if (std::sqrt(usual_V2 / 2) < kSeen * step_V) return variance_V2;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Differences& dwell = dwells[static_cast<std::size_t>(k)];
    const auto readings = static_cast<double>(set.poses[static_cast<std::size_t>(k)].count);
    // Five standard deviations of what chance does to so many; a code's edge near by does some,
    // too.
    const double clearly = std::max(1.5, 1 + 5 / std::sqrt(readings));
    if (dwell.typical_V > clearly * usual_V)
      variance_V2(k) = (dwell.mean_square_V2 - usual_V2) / 2 / readings;
  }
  return variance_V2;
}

}  // namespace plumbline
