// Slow noise of the run that the static record knows nothing of.
#pragma once

#include <vector>

#include "estimator/diagnosis/noise_drivers.h"
#include "estimator/diagnosis/search.h"

namespace plumbline {

/// The axes whose bias wanders in time more than the record and what was found leave room for: the
/// likelihoods of record and run with one noise for both and with one for each. No function of the
/// time describes it, or it would have been found; what it does to the parameters is in their
/// uncertainty. None without a record, nor where the steps of the converter are coarse.
std::vector<NoiseDriver> wanders_beyond_record(const SearchInput& input, const SearchResult& found);

}  // namespace plumbline
