// Sums of squared second differences over many lags at once, as fast as the processor can: the
// overlapping Allan variance.
#pragma once

#include <cstddef>
#include <vector>

namespace plumbline {

/// Σ_i (x[i+2m] − 2x[i+m] + x[i])² over all i with i + 2m < x.size(), for each m ≥ 1 in `lags`;
/// 0 where there is no such i.
///
/// The record is gone through once, a block at a time that stays in the processor's cache, and each
/// block serves all lags. Sums of blocks are added in a fixed order: the result does not depend on
/// the number of threads, nor on the width of the processor's vectors.
std::vector<double> second_difference_sums(const std::vector<double>& x,
                                           const std::vector<std::size_t>& lags,
                                           bool all_cores = true);

}  // namespace plumbline
