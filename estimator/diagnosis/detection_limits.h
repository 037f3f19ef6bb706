// How large each effect that was not found would have had to be.
#pragma once

#include <vector>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// For every named effect that is not in the model, axis by axis: the amplitude that is 5 standard
/// uncertainties in the final model, with the final noise, estimated together with everything in
/// the model. An effect without amplitude (a dead zone, a clipping limit) is stated by the size at
/// which its response stands out as much. Beside it, by how many σ the effect's best hypothesis
/// stands out of what the final model leaves: the best of many, so that noise alone gives some.
/// First order in amplitudes.
std::vector<DetectionLimit> detection_limits(const SearchInput& input, const CandidateList& list,
                                             const SearchResult& result);

}  // namespace plumbline
