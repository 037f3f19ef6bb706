#include "estimator/decision.h"

#include <cassert>

namespace plumbline {

const char* to_string(DecisionStatus status) {
  switch (status) {
    case DecisionStatus::pass:
      return "pass";
    case DecisionStatus::fail:
      return "fail";
    case DecisionStatus::conditional_pass:
      return "conditional_pass";
    case DecisionStatus::conditional_fail:
      return "conditional_fail";
    case DecisionStatus::none:
      break;
  }
  return "none";
}

const char* to_words(DecisionStatus status) {
  switch (status) {
    case DecisionStatus::pass:
      return "PASS";
    case DecisionStatus::conditional_pass:
      return "CONDITIONAL PASS";
    case DecisionStatus::conditional_fail:
      return "CONDITIONAL FAIL";
    case DecisionStatus::fail:
      return "FAIL";
    case DecisionStatus::none:
      break;
  }
  return "NO LIMIT STATED";
}

Decision decide(double limit_mps2, double max_abs_error_mps2, double u_mps2) {
  assert(limit_mps2 > 0 && max_abs_error_mps2 >= 0 && u_mps2 >= 0);
  Decision decision;
  decision.limit_mps2 = limit_mps2;
  decision.max_abs_error_mps2 = max_abs_error_mps2;
  decision.u_mps2 = u_mps2;
  decision.guard_band_mps2 = 2.0 * u_mps2;
  const double error = max_abs_error_mps2;
  if (error <= limit_mps2) {
    decision.status = error + decision.guard_band_mps2 <= limit_mps2
                          ? DecisionStatus::pass
                          : DecisionStatus::conditional_pass;
  } else {
    decision.status = error - decision.guard_band_mps2 <= limit_mps2
                          ? DecisionStatus::conditional_fail
                          : DecisionStatus::fail;
  }
  decision.rule =
      "The largest absolute error of a pose that took no part in the fit is compared with the "
      "limit "
      "under a guard band equal to its expanded uncertainty (k = 2): pass if the error plus the "
      "guard band is within the limit, fail if the error minus the guard band is beyond it, "
      "conditional pass or conditional fail in between, by the side on which the error itself "
      "lies.";
  return decision;
}

}  // namespace plumbline
