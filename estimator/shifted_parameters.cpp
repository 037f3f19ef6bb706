#include "estimator/shifted_parameters.h"

#include <algorithm>
#include <cmath>

namespace plumbline {

std::string parameter_name(std::size_t axis, Eigen::Index column) {
  const std::string of_axis = kAxisName[axis];
  return column == 3 ? "U_" + of_axis + "0"
                     : "K_" + of_axis + kAxisName[static_cast<std::size_t>(column)];
}

std::vector<ShiftedParameter> shifted_parameters(const Calibration& calibration) {
  constexpr double kCoverageFactor = 2;
  std::vector<ShiftedParameter> shifted;
  if (!calibration.diagnosis.enlarges_model()) return shifted;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisEstimate& after = calibration.final.batch_ls[axis];
    for (Eigen::Index column = 0; column < 4; ++column) {
      const double u = std::sqrt(std::max(0.0, after.covariance(column, column)));
      const double before = calibration.estimates.batch_ls[axis].value(column);
      if (std::abs(after.value(column) - before) > kCoverageFactor * u)
        shifted.push_back({axis, column, before, after.value(column), u});
    }
  }
  return shifted;
}

}  // namespace plumbline
