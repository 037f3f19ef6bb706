// Invented calibrations for tests of certificates: what is tested is that numbers are printed, not
// what they are.
#pragma once

#include <cmath>
#include <string>

#include "app/certificate/certificate.h"
#include "app/certificate/scalar_results.h"

namespace plumbline::app {

struct CertificateExample {
  RunDescription description;
  Calibration calibration;
  Provenance provenance;
  Evaluation verification;

  CertificateExample() {
    description.dut = {"A-<17>", "triad"};
    description.gravity = {9.8101, 0.00002};
    description.adc = Adc{16, -5, 0};
    provenance.dut = description.dut;
    provenance.created_utc = "2026-01-31T12:34:56Z";
    provenance.input_sha256 = {{"samples.csv", "0123456789abcdef"}};
    calibration.poses = 324;
    calibration.samples = 12960;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      AxisEstimate estimate;
      estimate.value = {0.001, 0.002, 0.0003, -2.5};
      estimate.value(static_cast<Eigen::Index>(i)) = 0.032002134;
      estimate.covariance = Eigen::Vector4d(1e-12, 1e-12, 4e-12, 1e-12).asDiagonal();
      calibration.estimates.batch_ls[i] = calibration.estimates.ekf[i] = estimate;
      calibration.floor_pose_rms_mps2[i] = 0.028;
      calibration.after.heldout_pose_rms_mps2[i] = 0.0291;
      calibration.after.fit_pose_rms_mps2[i] = 0.0279;
      calibration.after.heldout_pose_max_abs_mps2[i] = 0.0912;
      calibration.after.sample_rms_mps2[i] = 0.31;
      calibration.u_floor_pose_rms_mps2[i] = 0.0008;
      verification.after.pose_rms_mps2[i] = 0.0313;
      verification.after.pose_max_abs_mps2[i] = 0.0777;
      calibration.noise[i].source = "static record";
      calibration.noise[i].adequate = true;
      calibration.noise[i].oadev = {{1, 2, 4}, {9, 8, 7}, {3e-4, 2e-4, 1e-4}, {}, {}};
    }
    calibration.final = calibration.estimates;
    verification.poses = 24;
    for (int k = 0; k < 324; ++k) {
      PoseResult pose;
      pose.pose = {k, 10.0 * (k % 36), 10.0 * (k / 36), 0, 40};
      pose.t_mean_s = 6.4 * k;
      pose.temp_C = 20 + 0.01 * k;
      for (std::size_t i = 0; i < kAxisCount; ++i) {
        pose.residual_after_mps2[i] = 0.028 * std::sin(1.7 * k + static_cast<double>(i));
      }
      calibration.pose_results.push_back(pose);
      calibration.convergence.ekf.push_back(calibration.estimates.ekf);
      calibration.convergence.rls.push_back(calibration.estimates.ekf);
      calibration.convergence.batch_ls.push_back(calibration.estimates.ekf);
    }
    calibration.diagnosis.verdict = Verdict::clean;
    calibration.diagnosis.reason = "The residual is what the noise leaves.";
  }

  /// Effects were added: twice as large errors before.
  void add_effects(std::size_t count) {
    calibration.diagnosis.verdict = Verdict::explained;
    calibration.diagnosis.reason = "sensor.quadratic (x): k2 = 0.00212 ± 0.00011 g/g^2";
    calibration.before = calibration.after;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      calibration.before.heldout_pose_rms_mps2[i] *= 2;
      calibration.before.fit_pose_rms_mps2[i] *= 2;
    }
    for (PoseResult& pose : calibration.pose_results) {
      for (std::size_t i = 0; i < kAxisCount; ++i) {
        pose.residual_before_mps2[i] =
            pose.residual_after_mps2[i] + 0.08 * std::cos(pose.pose.h_deg * 0.0349);
      }
    }
    static constexpr const char* kIds[] = {
        "sensor.quadratic",        "sensor.cubic",  "sensor.cross_product",
        "sensor.temperature_bias", "sensor.warmup", "sensor.settling",
        "adc.code_step",           "rig.base_roll", "rig.delta_eccentricity",
        "rig.h_eccentricity",      "rig.backlash",  "env.base_field"};
    for (std::size_t k = 0; k < count; ++k) {
      FoundEffect effect;
      effect.id = kIds[k % std::size(kIds)];
      effect.axes = {0, 2};
      effect.parameters = {{"k2", 0, 0.00212, 0.00011, "g/g^2"}, {"c", {}, -0.0123, 0.0004, "deg"}};
      effect.p_value = 1e-9;
      effect.heldout_gain = 0.9 / static_cast<double>(count);
      effect.sigmas = 60 / static_cast<double>(k + 1);
      effect.alternatives = {"sensor.asymmetry", "rig.h_scale+rig.tilt_index"};
      effect.separate_by = "poses with h below the horizon";
      calibration.diagnosis.effects.push_back(effect);
    }
  }

  /// As many limits of detection as the list of effects gives.
  void add_not_found() {
    static constexpr const char* kUnits[] = {"g/g^2", "deg", "g/K", "s"};
    for (std::size_t k = 0; k < 45; ++k) {
      const auto number = static_cast<double>(k + 1);
      DetectionLimit limit{.id = k % 3 == 0 ? "rig.delta_periodic" : "sensor.temperature_scale",
                           .axis = {},
                           .parameter = "c" + std::to_string(k),
                           .limit = 0.00123 * number,
                           .unit = kUnits[k % 4],
                           .sigmas = 3 / number};
      if (k % 3 != 0) limit.axis = k % 3;
      calibration.diagnosis.not_found.push_back(limit);
    }
  }

  /// Names as long as a form allows, without a place to break.
  void make_names_long() {
    const std::string name(60, 'W');
    description.dut = {name, name};
    provenance.dut = description.dut;
    provenance.input_sha256 = {{name + ".csv", std::string(64, 'a')}};
    laboratory.laboratory = {name, name, name, name, "UA", name, name};
    laboratory.customer = laboratory.laboratory;
    laboratory.authorised_by = laboratory.authorised_role = laboratory.procedure = name;
    laboratory.head = laboratory.gravity = {name, name};
    for (auto& noise : calibration.noise) noise.remark = name + " " + name;
    UnlistedStructure unlisted;
    unlisted.driver = name;
    unlisted.form = "bias";
    unlisted.shape = name;
    unlisted.axes = {0, 1, 2};
    unlisted.parameters = {{name, 0, 1.5, 0.1, name}};
    calibration.diagnosis.unlisted.push_back(unlisted);
    for (int k = 0; k < 80; ++k) events.push_back({1e5 + k, name, name + " " + name});
  }

  CertificateInput input() const {
    return {description, calibration, provenance, &verification,
            events,      laboratory,  language,   result_sha256};
  }
  std::string html() const { return write_html(make_certificate(input())); }

  std::vector<CertificateEvent> events;
  Laboratory laboratory;
  Language language = Language::en;
  std::string result_sha256 = std::string(64, '7');
};

/// The same for a calibration without angles.
struct ScalarExample {
  CertificateExample common;
  ScalarCalibration calibration;
  ScalarSource source{
      "one rest for each number in the column pose", "LSB", {"ax_raw", "ay_raw", "az_raw"}};

  ScalarExample() {
    calibration.intervals = 40;
    calibration.samples = 8000;
    calibration.estimate.value << 32000, 32010, 31990, 0.0024, 0.0023, 0.0025, 0.001, -0.002, 0.003;
    calibration.estimate.covariance.diagonal() << 0.01, 0.02, 0.03, 1e-14, 2e-14, 3e-14, 1e-9, 2e-9,
        3e-9;
    calibration.final = calibration.estimate;
    calibration.before = calibration.after = common.calibration.after;
    calibration.floor_pose_rms_mps2 = common.calibration.floor_pose_rms_mps2;
    calibration.diagnosis = common.calibration.diagnosis;
    for (auto& noise : calibration.noise) noise.source = "bursts at the poses";
    for (int k = 0; k < 40; ++k) {
      RestResult rest;
      rest.t_mean_s = 10.0 * k;
      rest.residual_before_mps2 = 0.03 * std::sin(1.3 * k);
      rest.residual_after_mps2 = 0.02 * std::sin(1.7 * k);
      calibration.rests.push_back(rest);
    }
  }

  /// As CertificateExample::add_effects() and add_not_found().
  void add_findings() {
    common.add_effects(2);
    common.add_not_found();
    calibration.diagnosis = common.calibration.diagnosis;
    calibration.decision = {DecisionStatus::conditional_pass, 0.2, 0.19, 0.01, 0.02, ""};
  }

  /// The document alone: what an input refers to lives no longer than this call.
  Document document() const {
    const Calibration shared = shared_chapters(calibration);
    const ScalarResults results{calibration, source};
    CertificateInput input{common.description, shared, common.provenance, nullptr, common.events};
    input.laboratory = common.laboratory;
    input.language = common.language;
    input.result_sha256 = common.result_sha256;
    input.scalar = &results;
    return make_certificate(input);
  }
};

}  // namespace plumbline::app
