// What else would leave the same residual: single rivals, and sums of effects.
#pragma once

#include <string>
#include <vector>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// Explanations that these data cannot tell from effect `index` of the result, each an id or
/// several joined by "+", most likely first. `others` effects of the model stay as they are.
///
/// A rival counts when replacing the effect by it costs less likelihood than noise would
/// (`kIndistinguishable` in χ², more for every further parameter). Sums are looked for only as long
/// as a single rival does not do. `responses` are those of the list under the result's whitening.
std::vector<std::string> find_alternatives(const SearchInput& input, const CandidateList& list,
                                           const CandidateResponses& responses,
                                           const SearchResult& result, std::size_t index);

}  // namespace plumbline
