#include "estimator/fit/axis_tools.h"

#include <algorithm>
#include <cmath>

namespace plumbline {
AxisEstimate with_gravity(AxisEstimate estimate, const Gravity& gravity, double inflation) {
  estimate.covariance *= inflation;
  const double relative = gravity.u_mps2 / gravity.local_mps2;
  const Eigen::Vector3d K = estimate.value.head<3>();
  estimate.covariance.topLeftCorner<3, 3>() += relative * relative * K * K.transpose();
  return estimate;
}

double largest_en(const AxisEstimate& first, const AxisEstimate& second) {
  const Eigen::Vector4d U =
      2.0 * (first.covariance.diagonal() + second.covariance.diagonal()).cwiseSqrt();
  return (first.value - second.value).cwiseAbs().cwiseQuotient(U).maxCoeff();
}

EightStateOptions filter_options(const std::vector<PoseMean>& poses) {
  EightStateOptions options;
  const double first_s = poses.front().t_arrival_s;
  const double duration_s = poses.back().t_mean_s - first_s;
  const double spacing_s = duration_s / static_cast<double>(poses.size());
  // The stand-in for flicker fits about a decade: it is put in the middle of the times that the
  // run can tell apart. The ramp is one over the whole run.
  options.flicker_correlation_s = std::sqrt(spacing_s * duration_s);
  options.ramp_frequency_rad_s = 1.0 / duration_s;
  return options;
}

}  // namespace plumbline
