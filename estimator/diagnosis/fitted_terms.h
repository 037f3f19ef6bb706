// What each effect of the model does at every pose, against the variable that shows it best.
#pragma once

#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/enlarged_model.h"

namespace plumbline {

/// One entry for each effect of `model`, largest against the expected residual first: on the axis
/// where it is largest, over the driver of which its values look most like a function (von
/// Neumann's ratio of successive differences). `predicted_V`: predict_means_V() of the model;
/// `expected_mps2`: RMS of the pose means from noise alone. Effects without any course over the
/// poses are left out.
std::vector<FittedTerm> fitted_terms(const VisitLog& log, const EnlargedParameters& model,
                                     const PerAxis<Eigen::VectorXd>& predicted_V,
                                     const PerAxis<double>& expected_mps2);

}  // namespace plumbline
