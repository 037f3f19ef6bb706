// The part `uncertainty` of result.json: budget, GUM interval, Monte Carlo interval, comparison.
#pragma once

#include "app/io/json.h"
#include "estimator/uncertainty/monte_carlo.h"

namespace plumbline::app {

Json uncertainty_json(const UncertaintyReport& report);

}  // namespace plumbline::app
