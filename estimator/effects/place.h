// How well a place is known that no reading sees.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace plumbline::effect {

/// Standard uncertainty of a place of which only is known between which two of `values` it lies:
/// rectangular over the gap (GUM 4.3.7). 0 beyond all of them, where there is no such gap.
inline double u_between_neighbours(std::vector<double> values, double place) {
  std::sort(values.begin(), values.end());
  const auto next = std::upper_bound(values.begin(), values.end(), place);
  if (next == values.begin() || next == values.end()) return 0;
  return (*next - *(next - 1)) / std::sqrt(12.0);
}

}  // namespace plumbline::effect
