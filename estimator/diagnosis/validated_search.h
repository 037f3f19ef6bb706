// The search for effects, and which of those it finds carry over to poses that were left out of
// the fit.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "estimator/diagnosis/code_estimate.h"
#include "estimator/diagnosis/search.h"
#include "estimator/error_figures.h"
#include "estimator/pose_means.h"

namespace plumbline {

struct ValidatedSearch {
  std::unique_ptr<const VisitLog> log;  ///< that `codes` are from; null: that of the search
  CandidateList candidates;
  SearchResult found;
  std::optional<CodeEstimate> codes;
  /// Of each effect found: share of the excess power of left-out poses that it removes.
  std::vector<double> gains;
  PerAxis<LeftOutErrors> left_out;  ///< of the model found; empty where nothing was
};

/// Searches the residual of a finished 12-parameter calibration whose errors on left-out poses are
/// `before_mps2` (root mean square). `poses`: n, those of `search`; `own`: CalibrationOptions'.
/// Deterministic in input and options.
ValidatedSearch search_validated(const SearchInput& search, const CalibrationInput& measured,
                                 const std::vector<PoseMean>& poses,
                                 const PerAxis<double>& before_mps2,
                                 const std::vector<std::shared_ptr<const Effect>>& own,
                                 const SearchOptions& options);

}  // namespace plumbline
