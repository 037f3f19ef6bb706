// A recorded column as a cause: c·(v − mean v), or the same times a_i.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {

/// Bias and scale form for every recorded column, ids `covariate:<column>`.
std::vector<std::unique_ptr<Effect>> covariate_effects(const VisitLog& log);

/// The column of such an id; nothing when the id is of another kind.
std::optional<std::string> covariate_column(const std::string& id);

}  // namespace plumbline
