#include "app/io/result_json.h"

#include <cassert>
#include <cmath>

namespace plumbline::app {

namespace {

Json to_json(const AxisEstimate& estimate) {
  const auto& v = estimate.value;
  const Eigen::Vector4d u = estimate.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  Json covariance = Json::array();
  for (Eigen::Index row = 0; row < 4; ++row) {
    Json cells = Json::array();
    for (Eigen::Index column = 0; column < 4; ++column) {
      cells.push_back(json_number(estimate.covariance(row, column)));
    }
    covariance.push_back(std::move(cells));
  }
  return {{"K_V_per_g", json_numbers({v[0], v[1], v[2]})},
          {"U0_V", json_number(v[3])},
          {"u_K_V_per_g", json_numbers({u[0], u[1], u[2]})},
          {"u_U0_V", json_number(u[3])},
          {"covariance", std::move(covariance)}};
}

Json to_json(const TriadEstimate& triad) {
  return json_per_axis([&](std::size_t axis) { return to_json(triad[axis]); });
}

Json to_json(const ModelEstimates& estimates) {
  Json json = {{"batch_ls", to_json(estimates.batch_ls)}};
  if (estimates.rls) json["rls"] = to_json(*estimates.rls);
  json["ekf"] = to_json(estimates.ekf);
  json["agreement_en"] =
      json_per_axis([&](std::size_t axis) { return json_number(estimates.agreement_en[axis]); });
  return json;
}

Json to_json(const NoiseModel& noise) {
  return {{"source", noise.source},
          {"rate_hz", json_number(noise.rate_hz)},
          {"chi2", json_number(noise.chi2)},
          {"dof", json_number(noise.dof)},
          {"p_value", json_number(noise.p_value)},
          {"adequate", noise.adequate}};
}

Json json_parameters(const std::vector<EffectParameter>& reported) {
  Json parameters = Json::array();
  for (const EffectParameter& parameter : reported) {
    parameters.push_back(
        {{"name", parameter.name},
         {"axis", parameter.axis ? Json(kAxisName.at(*parameter.axis)) : Json(nullptr)},
         {"value", json_number(parameter.value)},
         {"u", json_number(parameter.u)},
         {"unit", parameter.unit}});
  }
  return parameters;
}

Json to_json(const FoundEffect& effect) {
  return {{"id", effect.id},
          {"axes", json_axis_names(effect.axes)},
          {"parameters", json_parameters(effect.parameters)},
          {"p_value", json_number(effect.p_value)},
          {"heldout_gain", json_number(effect.heldout_gain)},
          {"alternatives", effect.alternatives},
          {"separate_by", effect.separate_by}};
}

Json to_json(const UnlistedStructure& structure) {
  return {{"driver", structure.driver},
          {"form", structure.form},
          {"axes", json_axis_names(structure.axes)},
          {"shape", structure.shape},
          {"parameters", json_parameters(structure.parameters)},
          {"p_value", json_number(structure.p_value)},
          {"heldout_gain", json_number(structure.heldout_gain)}};
}

Json to_json(const Diagnosis& diagnosis) {
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
  return {{"verdict", to_string(diagnosis.verdict)},
          {"reason", diagnosis.reason},
          {"p_value", json_number(diagnosis.p_value)},
          {"residual_test", tests},
          {"effects", std::move(effects)},
          {"unlisted", std::move(unlisted)}};
}

Json to_json(const ErrorFigures& error) {
  return {{"fit_pose_rms", json_array(error.fit_pose_rms_mps2)},
          {"heldout_pose_rms", json_array(error.heldout_pose_rms_mps2)},
          {"heldout_pose_max_abs", json_array(error.heldout_pose_max_abs_mps2)},
          {"sample_rms", json_array(error.sample_rms_mps2)}};
}

Json to_json(const Decision& decision) {
  Json json = {{"status", to_string(decision.status)}};
  if (decision.status == DecisionStatus::none) return json;
  json["limit_mps2"] = json_number(decision.limit_mps2);
  json["max_abs_error_mps2"] = json_number(decision.max_abs_error_mps2);
  json["u_mps2"] = json_number(decision.u_mps2);
  json["guard_band_mps2"] = json_number(decision.guard_band_mps2);
  json["rule"] = decision.rule;
  return json;
}

}  // namespace

Json result_json(const Calibration& calibration, const Provenance& provenance) {
  assert(calibration.observability.rank == 4);
  return {{"schema", "plumbline.result/1"},
          {"provenance", json_provenance(provenance)},
          {"data",
           {{"poses", calibration.poses},
            {"samples", calibration.samples},
            {"skipped_rows", calibration.skipped_rows},
            {"axes", json_axis_names({0, 1, 2})},
            {"condition", json_number(calibration.observability.condition)}}},
          {"noise", json_per_axis([&](std::size_t axis) {
             return json_noise_terms(calibration.noise[axis], "V");
           })},
          {"noise_fit",
           json_per_axis([&](std::size_t axis) { return to_json(calibration.noise[axis]); })},
          {"estimates", to_json(calibration.estimates)},
          {"diagnosis", to_json(calibration.diagnosis)},
          {"final", to_json(calibration.final)},
          {"error",
           {{"before", to_json(calibration.before)},
            {"after", to_json(calibration.after)},
            {"floor",
             {{"pose_rms", json_array(calibration.floor_pose_rms_mps2)},
              {"u_pose_rms", json_array(calibration.u_floor_pose_rms_mps2)}}}}},
          {"decision", to_json(calibration.decision)}};
}

}  // namespace plumbline::app
