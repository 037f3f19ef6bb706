#include "app/io/result_json.h"

#include <cassert>
#include <cmath>

#include "app/io/diagnosis_json.h"
#include "app/io/uncertainty_json.h"
#include "estimator/parameter_name.h"
#include "estimator/shifted_parameters.h"

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

}  // namespace

namespace {

/// Per axis: null where the converter's steps do not matter.
Json quantization_json(const Calibration& calibration) {
  return json_per_axis([&](std::size_t axis) -> Json {
    const auto& use = calibration.quantization[axis];
    if (!use) return nullptr;
    return {{"method", "interval likelihood"},
            {"step_V", json_number(use->step_V)},
            {"sigma_V", json_number(use->sigma_V)},
            {"scatter_V", json_number(use->scatter_V)}};
  });
}

Json diagnosis_and_shifted(const Calibration& calibration) {
  Json json = json_diagnosis(calibration.diagnosis);
  Json shifted = Json::array();
  for (const ShiftedParameter& p : shifted_parameters(calibration))
    shifted.push_back({{"name", parameter_name(p.axis, p.column)},
                       {"before", json_number(p.before)},
                       {"after", json_number(p.after)},
                       {"u", json_number(p.u)},
                       {"unit", p.column == 3 ? "V" : "V/g"}});
  if (!shifted.empty()) json["shifted_parameters"] = std::move(shifted);
  return json;
}

Json ranges_json(const std::vector<ColumnRange>& ranges) {
  Json json = Json::object();
  for (const ColumnRange& range : ranges)
    json[range.column] = json_numbers({range.low, range.high});
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
            {"outlying_readings",
             json_per_axis([&](std::size_t axis) { return calibration.outlying_readings[axis]; })},
            {"ranges", ranges_json(calibration.ranges)},
            {"axes", json_axis_names({0, 1, 2})},
            {"condition", json_number(calibration.observability.condition)}}},
          {"noise", json_per_axis([&](std::size_t axis) {
             return json_noise_terms(calibration.noise[axis], "V");
           })},
          {"noise_fit",
           json_per_axis([&](std::size_t axis) { return to_json(calibration.noise[axis]); })},
          {"quantization", quantization_json(calibration)},
          {"estimates", to_json(calibration.estimates)},
          {"uncertainty",
           calibration.uncertainty ? uncertainty_json(*calibration.uncertainty) : Json(nullptr)},
          {"diagnosis", diagnosis_and_shifted(calibration)},
          {"final", to_json(calibration.final)},
          {"error", json_error(calibration)},
          {"decision", json_decision(calibration.decision)}};
}

}  // namespace plumbline::app
