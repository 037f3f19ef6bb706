#pragma once

#include <algorithm>
#include <cassert>
#include <iterator>
#include <vector>

namespace plumbline {

/// The middle one of the values, of an even number the upper of the two. Precondition: not empty.
inline double median(std::vector<double> values) {
  assert(!values.empty());
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace plumbline
