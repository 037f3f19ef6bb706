// Reads the example sets, just enough of CSV for files known to be good.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

inline std::map<std::string, std::vector<double>> read_columns(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  std::vector<std::string> names;
  std::istringstream header(line);
  for (std::string name; std::getline(header, name, ',');) names.push_back(name);
  std::map<std::string, std::vector<double>> columns;
  while (std::getline(file, line)) {
    const char* cursor = line.c_str();
    for (const std::string& name : names) {
      char* end = nullptr;
      columns[name].push_back(std::strtod(cursor, &end));
      cursor = *end == ',' ? end + 1 : end;
    }
  }
  return columns;
}

inline MeasurementSet read_set(const std::filesystem::path& path) {
  std::map<std::string, std::vector<double>> columns = read_columns(path);
  MeasurementSet set;
  set.samples.t_s = columns["t_s"];
  set.samples.u_V = {columns["ux_V"], columns["uy_V"], columns["uz_V"]};
  set.samples.temp_C = columns["temp_C"];
  const std::vector<double>& pose = columns["pose"];
  for (std::size_t i = 0; i < pose.size(); ++i) {
    if (i == 0 || pose[i] != pose[i - 1])
      set.poses.push_back(
          {static_cast<long long>(pose[i]), columns["delta_deg"][i], columns["h_deg"][i], i, 0});
    ++set.poses.back().count;
  }
  return set;
}

/// What all run.toml of the example sets say.
inline RunDescription example_description() {
  RunDescription description;
  description.gravity = {9.81012, 0.00002};
  description.adc = Adc{16, -5.0, 0.0};
  description.angles = {2.0, 2.0};
  return description;
}

}  // namespace plumbline
