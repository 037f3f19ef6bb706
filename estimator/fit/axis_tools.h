// What the batch fit and the filter of one axis have to agree on, and how their results compare.
#pragma once

#include <vector>

#include "estimator/calibrate.h"
#include "estimator/fit/eight_state_filter.h"
#include "estimator/pose_means.h"

namespace plumbline {

/// Adds what the fit cannot see: local gravity scales all of K alike. `inflation` is the Birge
/// ratio squared.
AxisEstimate with_gravity(AxisEstimate estimate, const Gravity& gravity, double inflation = 1);

/// Largest E_n = |x₁ − x₂| / √(U₁² + U₂²), U = 2u, of the four parameters (ISO/IEC 17043). Both
/// estimates use the same data, so that E_n is far below 1 unless one of them is wrong.
double largest_en(const AxisEstimate& first, const AxisEstimate& second);

/// Time constants of the filter's stand-ins for flicker and ramp on a run over these poses.
EightStateOptions filter_options(const std::vector<PoseMean>& poses);

}  // namespace plumbline
