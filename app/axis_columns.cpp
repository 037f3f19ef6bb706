#include "app/axis_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

namespace plumbline::app {

Result<std::vector<AxisColumn>> parse_axis_columns(const std::string& text) {
  std::vector<AxisColumn> columns;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const auto equals = part.find('=');
    const AxisColumn column{part.substr(0, equals),
                            equals == std::string::npos ? "" : part.substr(equals + 1)};
    const bool known =
        std::find(kAxisName.begin(), kAxisName.end(), column.axis) != kAxisName.end();
    const bool again = std::any_of(columns.begin(), columns.end(), [&](const AxisColumn& other) {
      return other.axis == column.axis;
    });
    if (!known || again || column.column.empty()) {
      return fail(ErrorCode::input,
                  fmt::format("--columns: \"{}\" is not AXIS=COLUMN with each of x, y, z at most "
                              "once",
                              part));
    }
    columns.push_back(column);
  }
  if (columns.empty()) return fail(ErrorCode::input, "--columns names no column");
  return columns;
}

std::string unit_of_column(const std::string& column) {
  const auto underscore = column.rfind('_');
  std::string suffix = underscore == std::string::npos ? "" : column.substr(underscore + 1);
  if (suffix == "V" || suffix == "g") return suffix;
  if (suffix == "mps2") return "m/s^2";
  return suffix == "lsb" || suffix == "raw" ? "LSB" : "unit";
}

}  // namespace plumbline::app
