#include "estimator/shifted_parameters.h"

#include <algorithm>
#include <cmath>

namespace plumbline {

std::vector<ShiftedParameter> shifted_parameters(const Calibration& calibration) {
  std::vector<ShiftedParameter> shifted;
  if (!calibration.diagnosis.enlarges_model()) return shifted;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisEstimate& after = calibration.final.batch_ls[axis];
    for (Eigen::Index column = 0; column < 4; ++column) {
      const ShiftedParameter parameter{
          axis, column, calibration.estimates.batch_ls[axis].value(column), after.value(column),
          std::sqrt(std::max(0.0, after.covariance(column, column)))};
      if (std::abs(parameter.after - parameter.before) > parameter.expanded_u())
        shifted.push_back(parameter);
    }
  }
  return shifted;
}

}  // namespace plumbline
