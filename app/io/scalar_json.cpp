#include "app/io/scalar_json.h"

#include <cmath>

#include "app/io/diagnosis_json.h"
#include "estimator/angle_units.h"

namespace plumbline::app {

namespace {

Json json_vector(const Eigen::Vector3d& v) { return json_numbers({v(0), v(1), v(2)}); }

Json json_angles(const Eigen::Vector3d& v) {
  return {{"yz", json_number(v(0))}, {"zy", json_number(v(1))}, {"zx", json_number(v(2))}};
}

/// The nine parameters; the keys that the fixed format names.
Json nine_json(const ScalarVector& v) {
  return {{"bias", json_vector(v.head<3>())},
          {"scale", json_vector(v.segment<3>(3))},
          {"nonorthogonality_rad", json_angles(v.tail<3>())}};
}

Json estimate_json(const ScalarEstimate& estimate) {
  Json json = nine_json(estimate.value);
  const ScalarVector u = estimate.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  json["u_bias"] = json_vector(u.head<3>());
  json["u_scale"] = json_vector(u.segment<3>(3));
  json["u_nonorthogonality_rad"] = json_angles(u.tail<3>());
  // What of T is measured: the angles between the sensitive axes, and their uncertainties.
  const Eigen::Vector3d cosine = axis_cosines(estimate.value);
  Eigen::Matrix<double, 3, kScalarCount> slope;
  for (Eigen::Index j = 0; j < kScalarCount; ++j) {
    constexpr double kStep = 1e-6;
    ScalarVector moved = estimate.value;
    const double step = kStep * (j < 6 ? std::abs(moved(j)) : 1);
    moved(j) += step;
    slope.col(j) =
        step > 0 ? Eigen::Vector3d((axis_cosines(moved) - cosine) / step) : Eigen::Vector3d::Zero();
  }
  const Eigen::Vector3d u_cosine =
      (slope * estimate.covariance * slope.transpose()).diagonal().cwiseMax(0).cwiseSqrt();
  const auto pairs = [](const Eigen::Vector3d& v) -> Json {
    return {{"xy", json_number(v(0))}, {"xz", json_number(v(1))}, {"yz", json_number(v(2))}};
  };
  json["axis_angle_deg"] = pairs(kDegPerRad * cosine.array().acos().matrix());
  json["u_axis_angle_deg"] =
      pairs(kDegPerRad * u_cosine.cwiseQuotient((1 - cosine.array().square()).sqrt().matrix()));
  Json covariance = Json::array();
  for (Eigen::Index row = 0; row < kScalarCount; ++row) {
    Json cells = Json::array();
    for (Eigen::Index column = 0; column < kScalarCount; ++column) {
      cells.push_back(json_number(estimate.covariance(row, column)));
    }
    covariance.push_back(std::move(cells));
  }
  json["covariance"] = std::move(covariance);
  return json;
}

Json head_json(const HeadComparison& head) {
  return {{"difference", nine_json(head.difference)},
          {"u_difference", nine_json(head.u_difference)},
          {"largest_en", json_number(head.largest_en)},
          {"direction_rms_deg", json_number(head.direction_rms_deg)},
          {"direction_max_deg", json_number(head.direction_max_deg)},
          {"expected_direction_rms_deg", json_number(head.expected_direction_rms_deg)},
          {"mounting_deg", json_number(head.mounting_deg)},
          {"words", head.words}};
}

Json noise_fit_json(const NoiseModel& noise) {
  return {{"source", noise.source},
          {"rate_hz", json_number(noise.rate_hz)},
          {"chi2", json_number(noise.chi2)},
          {"dof", json_number(noise.dof)},
          {"p_value", json_number(noise.p_value)},
          {"adequate", noise.adequate}};
}

}  // namespace

Json scalar_json(const ScalarCalibration& calibration, const ScalarSource& source,
                 const Provenance& provenance) {
  Json scalar = {{"model", "a = T·S·(m − b)"}};
  scalar.update(estimate_json(calibration.estimate));
  scalar["reading_unit"] = source.reading_unit;
  scalar["columns"] = {source.columns[0], source.columns[1], source.columns[2]};
  scalar["gauge"] =
      "|a| does not tell a rotation of the whole triad nor its sign: z_s is the sensitive axis z, "
      "x_s is perpendicular to the sensitive axes y and z, scales are positive; measured are the "
      "angles between the sensitive axes (axis_angle_deg)";
  scalar["rests"] = source.rests;
  scalar["intervals"] = calibration.intervals;
  scalar["residual_rms_mps2"] = json_number(calibration.residual_rms_mps2);
  scalar["expected_rms_mps2"] = json_number(calibration.expected_rms_mps2);
  scalar["expected_rms_correlated_mps2"] = json_number(calibration.expected_rms_blocks_mps2);
  scalar["scatter_mps2"] = json_number(calibration.scatter_mps2);
  if (calibration.diagnosis.enlarges_model()) {
    scalar["with_effects"] = estimate_json(calibration.final);
    scalar["with_effects"]["residual_rms_mps2"] = json_number(calibration.final_residual_rms_mps2);
  }
  if (calibration.head) scalar["head"] = head_json(*calibration.head);

  const std::string& unit = source.reading_unit;
  return {{"schema", "plumbline.result/1"},
          {"provenance", json_provenance(provenance)},
          {"data",
           {{"poses", calibration.intervals},
            {"samples", calibration.samples},
            {"skipped_rows", calibration.skipped_rows},
            {"axes", json_axis_names({0, 1, 2})},
            {"condition", json_number(calibration.condition)}}},
          {"noise", json_per_axis([&](std::size_t axis) {
             return json_noise_terms(calibration.noise[axis], unit);
           })},
          {"noise_fit", json_per_axis([&](std::size_t axis) {
             return noise_fit_json(calibration.noise[axis]);
           })},
          {"scalar", std::move(scalar)},
          {"diagnosis", json_diagnosis(calibration.diagnosis)},
          {"error", json_error(calibration)},
          {"decision", json_decision(calibration.decision)}};
}

}  // namespace plumbline::app
