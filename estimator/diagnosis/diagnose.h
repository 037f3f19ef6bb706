// From a residual to its causes: the search, what else it could be, and the words for it.
#pragma once

#include "estimator/calibrate.h"
#include "estimator/diagnosis/search.h"

namespace plumbline {

/// The diagnosis and the enlarged model it leads to.
struct Diagnosed {
  Diagnosis diagnosis;
  CandidateList candidates;  ///< owns effects that the model refers to
  SearchResult search;
};

/// Searches, lists rivals, tests what is left. Deterministic in input and options.
Diagnosed diagnose(const SearchInput& input, const SearchOptions& options);

/// Effects of a model as they are reported: one entry per id, axes and parameters together.
std::vector<FoundEffect> report_effects(const VisitLog& log, const EnlargedFit& fit);

}  // namespace plumbline
