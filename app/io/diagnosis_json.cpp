#include "app/io/diagnosis_json.h"

#include "estimator/angle_units.h"

namespace plumbline::app {

namespace {

Json json_parameters(const std::vector<EffectParameter>& reported) {
  Json parameters = Json::array();
  for (const EffectParameter& parameter : reported) {
    Json json = {{"name", parameter.name},
                 {"axis", parameter.axis ? Json(kAxisName.at(*parameter.axis)) : Json(nullptr)},
                 {"value", json_number(parameter.value)},
                 {"u", json_number(parameter.u)},
                 {"unit", parameter.unit}};
    if (parameter.filter) {
      json["ekf"] = {{"value", json_number(parameter.filter->value)},
                     {"u", json_number(parameter.filter->u)},
                     {"en", json_number(parameter.filter->en)}};
    }
    parameters.push_back(std::move(json));
  }
  return parameters;
}

Json to_json(const FoundEffect& effect) {
  Json json = {{"id", effect.id},
               {"axes", json_axis_names(effect.axes)},
               {"parameters", json_parameters(effect.parameters)},
               {"p_value", json_number(effect.p_value)},
               {"heldout_gain", json_number(effect.heldout_gain)},
               {"alternatives", effect.alternatives},
               {"separate_by", effect.separate_by}};
  if (!effect.definition.empty()) json["definition"] = effect.definition;
  return json;
}

Json to_json(const UnlistedStructure& structure) {
  return {{"driver", structure.driver},
          {"form", structure.form},
          {"axes", json_axis_names(structure.axes)},
          {"shape", structure.shape},
          {"parameters", json_parameters(structure.parameters)},
          {"p_value", json_number(structure.p_value)},
          {"heldout_gain", json_number(structure.heldout_gain)},
          {"alternatives", structure.alternatives},
          {"separate_by", structure.separate_by}};
}

Json to_json(const DetectionLimit& limit) {
  return {{"id", limit.id},
          {"axis", limit.axis ? Json(kAxisName.at(*limit.axis)) : Json(nullptr)},
          {"parameter", limit.parameter},
          {"limit", json_number(limit.limit)},
          {"best", json_number(limit.best)},
          {"worst", json_number(limit.worst)},
          {"unit", limit.unit}};
}

Json to_json(const RunHistory& history) {
  const auto column = [&](const auto& value) {
    std::vector<double> values;
    for (const Visit& visit : history.visits) values.push_back(value(visit));
    return json_numbers(values);
  };
  Json covariates = Json::object();
  for (std::size_t c = 0; c < history.covariate_names.size(); ++c)
    covariates[history.covariate_names[c]] =
        column([c](const Visit& visit) { return visit.covariate[c]; });
  Json json = {
      {"t_s", column([](const Visit& visit) { return visit.t_mean_s; })},
      {"delta_deg", column([](const Visit& visit) { return kDegPerRad * visit.delta_rad; })},
      {"h_deg", column([](const Visit& visit) { return kDegPerRad * visit.h_rad; })},
      {"covariates", std::move(covariates)}};
  if (history.has_temperature)
    json["above_reference_K"] = column([](const Visit& visit) { return visit.temperature_K; });
  return json;
}

}  // namespace

Json json_diagnosis(const Diagnosis& diagnosis) {
  Json effects = Json::array();
  for (const FoundEffect& effect : diagnosis.effects) effects.push_back(to_json(effect));
  Json unlisted = Json::array();
  for (const UnlistedStructure& structure : diagnosis.unlisted) {
    unlisted.push_back(to_json(structure));
  }
  const Json tests = json_per_axis([&](std::size_t axis) -> Json {
    const ResidualTest& test = diagnosis.axis_test[axis];
    return {{"statistic", json_number(test.statistic)},
            {"dof", json_number(test.dof)},
            {"p_value", json_number(test.p_value)}};
  });
  Json json = {{"verdict", to_string(diagnosis.verdict)},
               {"reason", diagnosis.reason},
               {"p_value", json_number(diagnosis.p_value)},
               {"residual_test", tests},
               {"effects", std::move(effects)},
               {"unlisted", std::move(unlisted)}};
  if (!diagnosis.not_found.empty()) {
    Json limits = Json::array();
    for (const DetectionLimit& limit : diagnosis.not_found) limits.push_back(to_json(limit));
    json["detection_limits"] = std::move(limits);
  }
  if (!diagnosis.history.visits.empty()) json["history"] = to_json(diagnosis.history);
  return json;
}

Json json_error_figures(const ErrorFigures& error) {
  return {{"fit_pose_rms", json_array(error.fit_pose_rms_mps2)},
          {"heldout_pose_rms", json_array(error.heldout_pose_rms_mps2)},
          {"heldout_pose_max_abs", json_array(error.heldout_pose_max_abs_mps2)},
          {"sample_rms", json_array(error.sample_rms_mps2)}};
}

Json json_decision(const Decision& decision) {
  Json json = {{"status", to_string(decision.status)}};
  if (decision.status == DecisionStatus::none) return json;
  json["limit_mps2"] = json_number(decision.limit_mps2);
  json["max_abs_error_mps2"] = json_number(decision.max_abs_error_mps2);
  json["u_mps2"] = json_number(decision.u_mps2);
  json["guard_band_mps2"] = json_number(decision.guard_band_mps2);
  json["rule"] = decision.rule;
  return json;
}

}  // namespace plumbline::app
