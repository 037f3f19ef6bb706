// "--columns x=ax_lsb,z=az_lsb": which column of somebody else's file is which axis.
#pragma once

#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

struct AxisColumn {
  std::string axis;    ///< "x", "y" or "z"
  std::string column;  ///< as in the header line
};

/// Refused (input) unless every part is AXIS=COLUMN with each axis at most once.
Result<std::vector<AxisColumn>> parse_axis_columns(const std::string& text);

/// The unit that a column's name ends in: "ux_V" is in V, "ax_raw" and "ax_lsb" in LSB.
std::string unit_of_column(const std::string& column);

}  // namespace plumbline::app
