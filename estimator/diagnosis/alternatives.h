// What else would leave the same residual: single rivals, and sums of effects.
#pragma once

#include <string>
#include <vector>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// An explanation that these data cannot tell from an effect that was found.
struct Alternative {
  std::string name;  ///< an id, or several joined by "+"
  EnlargedFit fit;   ///< the model with it in place of the effect, its own effects last
  double odds = 0;   ///< against what was found, which the search preferred: at most 1
  bool has_name = true;
};

/// Explanations that these data cannot tell from effect `index` of the result, most likely first.
/// The other effects of the model stay as they are.
///
/// A rival counts when replacing the effect by it costs less likelihood than noise would
/// (`kIndistinguishable` in χ², more for every further parameter). Sums are looked for only as long
/// as a single rival does not do. Functions of other drivers and of other forms count, too, but
/// beside a name only with no more parameters: with more they can imitate anything.
std::vector<Alternative> find_alternatives(const SearchInput& input, const CandidateList& list,
                                           const SearchResult& result, std::size_t index);

/// What it adds to the covariance of the free parameters that an alternative of effect `index` may
/// be true instead: Σ w·d·dᵀ over the alternatives, d how the parameters are others with it and w
/// its share of the odds (the between-model part of Burnham & Anderson 2002, eq. 4.9, about the
/// model that was chosen). Zero in the rows of the effect itself, which the alternative lacks.
/// `found`: the model as the same readings give it that gave the alternatives.
Eigen::MatrixXd covariance_among(const EnlargedParameters& found, std::size_t index,
                                 const std::vector<Alternative>& alternatives);

}  // namespace plumbline
