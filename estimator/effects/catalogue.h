// The one list of effects.
#pragma once

#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {

/// Every effect that is known by name, except recorded columns (covariate.h).
const std::vector<const Effect*>& effect_catalogue();

}  // namespace plumbline
