// Conformity with an acceptance limit under a guard band.
#pragma once

#include "estimator/calibrate.h"

namespace plumbline {

/// Judges the largest error against a symmetric limit with a guard band w = U = 2·u
/// (ILAC-G8:09/2019, four outcomes): pass when error + U ≤ limit; conditional pass when error ≤
/// limit < error + U; conditional fail when error − U ≤ limit < error; fail when limit < error − U.
/// Preconditions: all arguments ≥ 0 and finite, limit > 0.
Decision decide(double limit_mps2, double max_abs_error_mps2, double u_mps2);

/// As people write it: "CONDITIONAL PASS"; "NO LIMIT STATED" without a limit.
const char* to_words(DecisionStatus status);

}  // namespace plumbline
