#pragma once

#include <algorithm>
#include <cassert>
#include <iterator>
#include <utility>
#include <vector>

namespace plumbline {

/// The middle one of the values, of an even number the upper of the two. Precondition: not empty.
inline double median(std::vector<double> values) {
  assert(!values.empty());
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Standard deviation of the Gaussian noise of which these are the distances from its mean, by
/// their median: a few that are far off do not count. Precondition: not empty.
inline double sd_of_distances(std::vector<double> distances) {
  constexpr double kMedianDistance = 0.6745;  // in standard deviations
  return median(std::move(distances)) / kMedianDistance;
}

}  // namespace plumbline
