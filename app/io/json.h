// What the JSON writers share.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "app/provenance.h"
#include "estimator/measurement.h"
#include "estimator/noise/noise_model.h"

namespace plumbline::app {

/// Keys stay in the order in which they are written, so that equal results are equal bytes.
using Json = nlohmann::ordered_json;

/// JSON has no NaN and no infinity: they are written as null.
Json json_number(double value);
Json json_numbers(const std::vector<double>& values);

/// [x, y, z]
Json json_array(const PerAxis<double>& values);
/// ["x", "z"] for {0, 2}
Json json_axis_names(const std::vector<std::size_t>& axes);

/// {"x": f(0), "y": f(1), "z": f(2)}
template <class F>
Json json_per_axis(F&& f) {
  Json object = Json::object();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) object[kAxisName[axis]] = f(axis);
  return object;
}

Json json_provenance(const Provenance& provenance);

/// The terms Q, N, B, K, R of a channel recorded in `unit`, each with its own unit.
Json json_noise_terms(const NoiseModel& noise, const std::string& unit);

/// Indented, with a newline at the end: the text of a file.
std::string file_text(const Json& json);

}  // namespace plumbline::app
