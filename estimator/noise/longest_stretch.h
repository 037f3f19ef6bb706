// Records with gaps: curves and spectra want samples at an even step.
#pragma once

#include <cstddef>
#include <vector>

namespace plumbline {

/// Rows [first, first + count) of a record, sampled without a gap.
struct Stretch {
  std::size_t first = 0;
  std::size_t count = 0;
  double step_s = 0;     ///< mean time between its samples; 0 with fewer than two
  std::size_t gaps = 0;  ///< in the whole record: steps longer than 1.5 times the median step
};

/// The longest of the stretches between gaps. `t_s` increases strictly.
Stretch longest_stretch(const std::vector<double>& t_s);

}  // namespace plumbline
