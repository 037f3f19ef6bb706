#include <fmt/format.h>

#include <algorithm>

#include "app/config/own_effects.h"
#include "app/io/read_file.h"
#include "app/io/result_json.h"
#include "estimator/angle_units.h"

namespace plumbline::app {

namespace {

std::size_t axis_named(const Json& name) {
  const auto text = name.get<std::string>();
  const auto it = std::find(kAxisName.begin(), kAxisName.end(), text);
  if (it == kAxisName.end()) throw std::invalid_argument("there is no axis \"" + text + "\"");
  return static_cast<std::size_t>(it - kAxisName.begin());
}

AxisEstimate axis_estimate(const Json& json) {
  AxisEstimate estimate;
  for (std::size_t i = 0; i < 3; ++i) {
    estimate.value[static_cast<Eigen::Index>(i)] = json.at("K_V_per_g").at(i).get<double>();
  }
  estimate.value[3] = json.at("U0_V").get<double>();
  for (std::size_t row = 0; row < 4; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      estimate.covariance(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          json.at("covariance").at(row).at(column).get<double>();
    }
  }
  return estimate;
}

TriadEstimate triad_estimate(const Json& json) {
  TriadEstimate triad;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    triad[axis] = axis_estimate(json.at(kAxisName[axis]));
    const auto diagonal = static_cast<Eigen::Index>(axis);
    if (triad[axis].value[diagonal] == 0) {
      throw std::invalid_argument(fmt::format("the scale factor of axis {} is 0", kAxisName[axis]));
    }
  }
  return triad;
}

std::vector<std::size_t> axes_named(const Json& names) {
  std::vector<std::size_t> axes;
  for (const Json& name : names) axes.push_back(axis_named(name));
  return axes;
}

std::vector<EffectParameter> effect_parameters(const Json& items) {
  std::vector<EffectParameter> parameters;
  for (const Json& item : items) {
    EffectParameter parameter;
    parameter.name = item.at("name").get<std::string>();
    if (!item.at("axis").is_null()) parameter.axis = axis_named(item.at("axis"));
    parameter.value = item.at("value").get<double>();
    parameter.u = item.at("u").get<double>();
    parameter.unit = item.at("unit").get<std::string>();
    parameters.push_back(std::move(parameter));
  }
  return parameters;
}

FoundEffect found_effect(const Json& json) {
  FoundEffect effect;
  effect.id = json.at("id").get<std::string>();
  effect.axes = axes_named(json.at("axes"));
  effect.parameters = effect_parameters(json.at("parameters"));
  effect.definition = json.value("definition", "");
  return effect;
}

UnlistedStructure unlisted_structure(const Json& json) {
  UnlistedStructure structure;
  structure.driver = json.at("driver").get<std::string>();
  structure.form = json.at("form").get<std::string>();
  structure.axes = axes_named(json.at("axes"));
  structure.shape = json.at("shape").get<std::string>();
  structure.parameters = effect_parameters(json.at("parameters"));
  return structure;
}

RunHistory run_history(const Json& json) {
  RunHistory history;
  history.has_temperature = json.contains("above_reference_K");
  for (const auto& [name, values] : json.at("covariates").items())
    history.covariate_names.push_back(name);
  for (std::size_t k = 0; k < json.at("t_s").size(); ++k) {
    Visit visit;
    visit.t_mean_s = json.at("t_s").at(k).get<double>();
    visit.delta_rad = kRadPerDeg * json.at("delta_deg").at(k).get<double>();
    visit.h_rad = kRadPerDeg * json.at("h_deg").at(k).get<double>();
    if (history.has_temperature)
      visit.temperature_K = json.at("above_reference_K").at(k).get<double>();
    for (const std::string& name : history.covariate_names)
      visit.covariate.push_back(json.at("covariates").at(name).at(k).get<double>());
    history.visits.push_back(std::move(visit));
  }
  return history;
}

StoredCalibration stored_calibration(const Json& json, double reference_C) {
  if (const auto schema = json.at("schema").get<std::string>(); schema != "plumbline.result/1") {
    throw std::invalid_argument(
        fmt::format("its schema is \"{}\" instead of \"plumbline.result/1\"", schema));
  }
  StoredCalibration stored;
  stored.model.twelve = triad_estimate(json.at("estimates").at("batch_ls"));
  stored.model.final = triad_estimate(json.at("final").at("batch_ls"));
  for (const Json& effect : json.at("diagnosis").at("effects")) {
    stored.model.effects.push_back(found_effect(effect));
    const FoundEffect& found = stored.model.effects.back();
    if (found.definition.empty()) continue;
    const auto own = parse_own_effects(found.definition, found.id + ", definition", reference_C);
    if (!own) throw std::invalid_argument(own.error().message);
    stored.model.own_effects.insert(stored.model.own_effects.end(), own->begin(), own->end());
  }
  for (const Json& structure : json.at("diagnosis").at("unlisted")) {
    stored.model.unlisted.push_back(unlisted_structure(structure));
  }
  if (json.at("diagnosis").contains("history"))
    stored.model.history = run_history(json.at("diagnosis").at("history"));
  if (json.contains("data") && json.at("data").contains("ranges")) {
    for (const auto& [column, range] : json.at("data").at("ranges").items())
      stored.model.ranges.push_back({column, range.at(0).get<double>(), range.at(1).get<double>()});
  }
  const Json& dut = json.at("provenance").at("dut");
  stored.dut.serial = dut.at("serial").get<std::string>();
  stored.dut.model = dut.at("model").get<std::string>();
  return stored;
}

}  // namespace

Result<StoredCalibration> parse_result_json(std::string_view text, const std::string& name,
                                            double reference_C) {
  try {
    return stored_calibration(Json::parse(text), reference_C);
  } catch (const std::exception& error) {
    return fail(ErrorCode::input,
                fmt::format("{}: not a usable result.json: {}", name, error.what()));
  }
}

Result<StoredCalibration> read_result_json(const std::filesystem::path& path, double reference_C) {
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  return parse_result_json(*text, path.string(), reference_C);
}

}  // namespace plumbline::app
