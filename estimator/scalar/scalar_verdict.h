// From residual and search of an angle-free set to the diagnosis that is reported.
#pragma once

#include "estimator/scalar/calibrate_scalar.h"
#include "estimator/scalar/scalar_search.h"

namespace plumbline {

struct ScalarVerdictInput {
  const ScalarSearchResult& search;
  const InnerVariance& inner;
  const VisitLog& log;
  /// Loss of likelihood without scatter from rest to rest, the nine parameters alone.
  double scatter_gain = 0;
};

/// Fills effects, unlisted, verdict, reason and p_value of result.diagnosis; the figures of
/// `result` must be there.
void decide_scalar_verdict(const ScalarVerdictInput& input, ScalarCalibration& result);

}  // namespace plumbline
