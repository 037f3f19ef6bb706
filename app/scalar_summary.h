// A calibration without angles in a few lines for the person at the terminal.
#pragma once

#include <string>

#include "app/scalar_job.h"

namespace plumbline::app {

/// Rests, parameters with expanded uncertainties (k = 2), residual against what the noise leaves,
/// verdict. The last line says what came out.
std::string scalar_summary(const RunDescription& description, const ScalarCalibration& calibration,
                           const ScalarSource& source);

}  // namespace plumbline::app
