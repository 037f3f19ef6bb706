// The angle-free calibration as a judge of the dividing head.
#pragma once

#include "estimator/scalar/calibrate_scalar.h"

namespace plumbline {

/// Compares with the 12-parameter least-squares fit of the same rests to the commanded angles.
/// Nothing when the angles do not determine that model. `covariance_V2`: of nothing else than the
/// scatter inside, per rest and axis.
std::optional<HeadComparison> compare_with_head(const ScalarInput& input,
                                                const ScalarEstimate& scalar, double scatter_mps2);

}  // namespace plumbline
