// Estimation from codes beside effects: where a converter turned out to round to a coarser step
// than declared, its codes say more of the voltages than the means do.
#pragma once

#include <optional>
#include <vector>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// A model estimated from codes. What rounds is no part of `fit`, `noise` and `whitening`: a
/// reading stands for the voltage before the converter.
struct CodeEstimate {
  SearchResult before_converter;
  std::vector<std::size_t> left_out;  ///< effects of the whole model that are left out
  /// Stacked: by how much the voltages are others where a step and its origin are one standard
  /// deviation away, each independent of the others.
  std::vector<Eigen::VectorXd> deviation_V;

  /// An estimate of that model as one of the whole model `found`. How far noise rounds the steps
  /// off stays as the means have it: noise of every kind does.
  EnlargedEstimate with_converter(const EnlargedEstimate& estimate,
                                  const SearchResult& found) const;
};

/// From the model as found. Near an edge between two codes the mean of a dwell is sharp and away
/// from the edges it is worth nothing, which least squares of means does not know: it is neither
/// the best estimate nor does it know its uncertainty (quantized_axis.h). Of the axes with a step
/// that was found, and with a declared one that noise leaves its edges (otherwise undoing rounding
/// to first order is as good); nothing where there are none.
std::optional<CodeEstimate> estimate_from_codes(const SearchInput& input, const MeasurementSet& run,
                                                const SearchResult& found);

}  // namespace plumbline
