// The twelve parameters by name.
#pragma once

#include <Eigen/Core>
#include <string>

#include "estimator/measurement.h"

namespace plumbline {

/// "K_xy"; column 3: "U_x0".
inline std::string parameter_name(std::size_t axis, Eigen::Index column) {
  const std::string of_axis = kAxisName.at(axis);
  return column == 3 ? "U_" + of_axis + "0"
                     : "K_" + of_axis + kAxisName.at(static_cast<std::size_t>(column));
}

}  // namespace plumbline
