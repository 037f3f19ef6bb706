// Errors of the enlarged model on poses that were left out of its fit.
#pragma once

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/error_figures.h"

namespace plumbline {

/// Residuals, V, of each axis's poses against the fit to all poses outside their block (all three
/// axes of a block are left out together), to first order in the parameters, without refitting.
/// One vector of n per axis; poses in no block are NaN. fit and whitening belong together; `mean_V`
/// are the measured pose means.
PerAxis<Eigen::VectorXd> heldout_residuals_V(const VisitLog& log,
                                             const PerAxis<Eigen::VectorXd>& mean_V,
                                             const PoseWhitening& whitening, const EnlargedFit& fit,
                                             const Blocks& blocks);

}  // namespace plumbline
