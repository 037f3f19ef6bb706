// From a residual to its causes: the search, what else it could be, and the words for it.
#pragma once

#include <vector>

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

/// Fills effects, unlisted, verdict and words of the diagnosis from the search's final model.
void describe_findings(const SearchInput& input, Diagnosed& diagnosed);

/// Shares of the held-out excess that the effects remove, in the order of the search's evidence.
void attach_gains(Diagnosed& diagnosed, const std::vector<double>& gains);

}  // namespace plumbline
