// A recorded column as a cause: c·(v − mean v), or the same times a_i.
#pragma once

#include <memory>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {

/// Bias and scale form for every recorded column, ids `covariate:<column>`.
std::vector<std::unique_ptr<Effect>> covariate_effects(const VisitLog& log);

}  // namespace plumbline
