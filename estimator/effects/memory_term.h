// Straight lines in what a variable was on average lately: creep, moisture, heat that lags behind.
#pragma once

#include <memory>
#include <vector>

#include "estimator/effects/driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// Proportional to the average of the past with weight exp(−age/τ), τ unknown: of every recorded
/// column, of a column less its average, which is its rate without the noise of a slope, and of the
/// specific force of the own axis less its average, which is nothing at rest; added to the bias and
/// to the scale, of columns also to the angles of head and base; of the square of a column that
/// takes both signs (what a current heats), of square and sign of the own axis's specific force, of
/// that of another axis less its average, added to the bias; the fading sum of the ways of the
/// head, added to the bias, δ and h; the fading sum of the pauses, added to bias and scale; of the
/// weight across the arm, added to h. With and without a beginning that differs from what the first
/// visit shows. And what a column was a time τ before, added to bias, scale and h.
///
/// No τ beyond `longest_s`: what hardly changes over a run is not to be told from the 12
/// parameters.
std::vector<std::unique_ptr<SmoothTerm>> memory_terms(const VisitLog& log, double longest_s,
                                                      const DriverPointer& attitude,
                                                      const std::vector<DriverPointer>& columns);

}  // namespace plumbline
