// From a residual to its causes: the search, what else it could be, and the words for it.
#pragma once

#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/search.h"

namespace plumbline {

/// The diagnosis and the enlarged model it leads to.
struct Diagnosed {
  HeadReach reach = {};  ///< for suggested poses
  Diagnosis diagnosis;
  CandidateList candidates;  ///< owns effects that the model refers to
  SearchResult search;
};

/// Searches for what is listed and for `own_effects`, lists rivals and what would decide between
/// them. Deterministic in input and options.
Diagnosed diagnose(const SearchInput& input, const SearchOptions& options,
                   const CalibrationOptions& calibration);

/// Fills effects, unlisted, verdict and words of the diagnosis from the search's final model.
void describe_findings(const SearchInput& input, Diagnosed& diagnosed);

/// The filter's estimates of the effects' free parameters, in the order of the model's free values
/// from the thirteenth on.
void attach_filter(Diagnosed& diagnosed, const Eigen::VectorXd& value, const Eigen::VectorXd& u);

/// Shares of the held-out excess that the effects remove, in the order of the search's evidence.
void attach_gains(Diagnosed& diagnosed, const std::vector<double>& gains);

}  // namespace plumbline
