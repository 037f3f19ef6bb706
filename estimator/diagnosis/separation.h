// What would tell an effect from the rivals that these data leave open.
#pragma once

#include <string>
#include <vector>

#include "estimator/diagnosis/alternatives.h"

namespace plumbline {

struct Separation {
  std::string words;    ///< for a person: what to do, and what it decides
  SeparatingPlan plan;  ///< empty when no further poses of this head decide anything
};

/// Poses that decide between effect `index` of the result and each of its rivals: those where the
/// fitted models differ most in units of the noise after the rival has been fitted again to all
/// (T-optimality, Atkinson & Fedorov, Biometrika 62, 1975). Further poses, other orders, repeats
/// and longer dwells are tried as they would come after the run; the fewest that decide most rivals
/// at 5 standard deviations are proposed. Where none do, the words name the mounting that would.
Separation separate(const SearchInput& input, const SearchResult& result, std::size_t index,
                    const std::vector<Alternative>& rivals, const HeadReach& reach);

/// What a run visited, as far as one turn of the spindle.
HeadReach reach_of(const VisitLog& log);

}  // namespace plumbline
