#include "app/certificate/scalar_certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/certificate/rounding.h"
#include "app/figure/plot.h"

namespace plumbline::app {

namespace {

constexpr double kCoverageFactor = 2;
constexpr double kMilli = 1e3;

std::string milli_mps2(double value_mps2) { return significant(kMilli * value_mps2, 3); }

std::string full_stop(std::string text) {
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

void add_identification(Document& document, const ScalarCertificateInput& input) {
  const RunDescription& run = input.description;
  document.blocks.push_back(Heading{"Item and conditions"});
  Facts facts;
  facts.rows = {
      {"Laboratory", ""},
      {"Customer", ""},
      {"Item", run.dut.model.empty() ? "accelerometer triad" : run.dut.model},
      {"Serial number", run.dut.serial},
      {"Condition of the item", ""},
      {"Evaluated", input.provenance.created_utc},
      {"Method",
       fmt::format("scalar calibration: at rest the specific force has the magnitude of local "
                   "gravity whatever the attitude; {} rests, {} readings, no angles used",
                   input.calibration.intervals, input.calibration.samples)},
      {"Rests", input.source.rests},
      {"Local gravity",
       run.gravity.u_mps2 > 0
           ? fmt::format("g = {}, k = 2",
                         result_with_unit(run.gravity.local_mps2, 2 * run.gravity.u_mps2, "m/s²"))
           : fmt::format("g = {} m/s²; uncertainty not stated",
                         significant(run.gravity.local_mps2, 7))},
      {"Traceability of g", ""},
      {"Authorised by", ""}};
  document.blocks.push_back(std::move(facts));
}

void add_parameters(Document& document, const ScalarCertificateInput& input) {
  const std::string& unit = input.source.reading_unit;
  document.blocks.push_back(Heading{"Results"});
  document.blocks.push_back(Paragraph{
      "Specific force:  a = T·S·(m − b), with the reading m, the bias b, S = diag(scale) and T = "
      "[[1, −yz, zy], [0, 1, −zx], [0, 0, 1]]. The magnitude of a does not tell a rotation of the "
      "whole triad nor its sign: z is the sensitive axis z, x is perpendicular to the sensitive "
      "axes y and z, the scales are positive. Expanded uncertainties with coverage factor k = 2 "
      "(about 95 %)."});
  const bool enlarged =
      !input.calibration.diagnosis.effects.empty() || !input.calibration.diagnosis.unlisted.empty();
  const auto table_of = [&](const ScalarEstimate& estimate, const std::string& caption) {
    Table table;
    table.caption = caption;
    table.header = {"axis", "bias, " + unit, "U", "scale, m/s² per " + unit, "U"};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const auto i = static_cast<Eigen::Index>(axis);
      const RoundedResult bias = round_result(estimate.value(i), kCoverageFactor * estimate.u(i));
      const RoundedResult scale =
          round_result(estimate.value(3 + i), kCoverageFactor * estimate.u(3 + i));
      table.rows.push_back(
          {kAxisName[axis], bias.value, bias.uncertainty, scale.value, scale.uncertainty});
    }
    document.blocks.push_back(std::move(table));
    Table angles;
    angles.caption = "Non-orthogonality";
    angles.header = {"angle", "mrad", "U"};
    constexpr const char* kAngle[] = {"yz", "zy", "zx"};
    for (Eigen::Index i = 0; i < 3; ++i) {
      const RoundedResult angle = round_result(kMilli * estimate.value(6 + i),
                                               kMilli * kCoverageFactor * estimate.u(6 + i));
      angles.rows.push_back({kAngle[i], angle.value, angle.uncertainty});
    }
    document.blocks.push_back(std::move(angles));
  };
  table_of(input.calibration.estimate, "Nine parameters");
  if (enlarged) {
    table_of(input.calibration.final, "Nine parameters, re-estimated together with the effects");
  }
}

void add_diagnosis(Document& document, const ScalarCalibration& calibration) {
  document.blocks.push_back(Heading{"Error of the calibrated model"});
  Table table;
  table.caption =
      "Residual |a| − g, mm/s²; per axis weighted with the axis's share of gravity squared";
  table.header = {"", "x", "y", "z"};
  const auto row = [&](const char* label, const PerAxis<double>& v) {
    table.rows.push_back({label, milli_mps2(v[0]), milli_mps2(v[1]), milli_mps2(v[2])});
  };
  row("nine parameters, rests left out of the fit", calibration.before.heldout_pose_rms_mps2);
  row("certified model, rests left out of the fit", calibration.after.heldout_pose_rms_mps2);
  row("certified model, largest", calibration.after.heldout_pose_max_abs_mps2);
  row("what the noise inside the rests would leave", calibration.floor_pose_rms_mps2);
  document.blocks.push_back(std::move(table));
  const Diagnosis& diagnosis = calibration.diagnosis;
  const bool warn =
      diagnosis.verdict == Verdict::unexplained || diagnosis.verdict == Verdict::partly_explained;
  document.blocks.push_back(Paragraph{
      fmt::format("Residual {}: {}", to_string(diagnosis.verdict), full_stop(diagnosis.reason)),
      warn ? Tone::warning : Tone::plain});
  if (!diagnosis.effects.empty()) {
    Table effects;
    effects.caption = "Effects found in the residual and added to the model";
    effects.header = {"effect", "parameters", "p-value", "could also be"};
    for (const FoundEffect& effect : diagnosis.effects) {
      std::string parameters, others;
      for (const EffectParameter& p : effect.parameters) {
        parameters += (parameters.empty() ? "" : "; ") + p.name +
                      (p.axis ? fmt::format(" ({})", kAxisName.at(*p.axis)) : "") + " = " +
                      result_with_unit(p.value, kCoverageFactor * p.u, p.unit);
      }
      for (const std::string& other : effect.alternatives) {
        others += (others.empty() ? "" : "; ") + other;
      }
      effects.rows.push_back({effect.id, parameters, significant(effect.p_value, 2), others});
    }
    document.blocks.push_back(std::move(effects));
  }
  if (calibration.head) {
    document.blocks.push_back(
        Paragraph{"Cross-check of the head: " + calibration.head->words + "."});
  }
}

Figure residual_figure(const ScalarCalibration& calibration) {
  Figure figure;
  figure.caption =
      "Residual |a| − g of every rest over time: nine parameters (grey), certified model (blue)";
  figure.description = "Scatter plot of the residual of every rest against time";
  figure.draw = [&calibration, width = figure.width, height = figure.height](Canvas& canvas) {
    std::vector<double> t, before, after;
    double largest = 1e-9;
    for (const RestResult& rest : calibration.rests) {
      t.push_back(rest.t_mean_s);
      before.push_back(kMilli * rest.residual_before_mps2);
      after.push_back(kMilli * rest.residual_after_mps2);
      largest = std::max({largest, std::abs(before.back()), std::abs(after.back())});
    }
    Plot plot(canvas, {70, 20}, width - 90, height - 70,
              {.label = "time, s", .min = t.front(), .max = std::max(t.back(), t.front() + 1)},
              {.label = "|a| − g, mm/s²", .min = -1.1 * largest, .max = 1.1 * largest});
    plot.draw_frame();
    plot.points(t, before, 3, palette::kGrey);
    plot.points(t, after, 2, palette::kBlue);
  };
  return figure;
}

}  // namespace

Document make_scalar_certificate(const ScalarCertificateInput& input) {
  const ScalarCalibration& calibration = input.calibration;
  Document document;
  document.title = "Calibration certificate";
  document.subtitle = fmt::format("Accelerometer triad, serial number {}; scalar calibration",
                                  input.description.dut.serial);
  document.id = certificate_id(input.provenance);
  document.words.end = fmt::format("— end of certificate {} —", document.id);
  const Verdict verdict = calibration.diagnosis.verdict;
  const bool suspicious = verdict == Verdict::unexplained || verdict == Verdict::partly_explained;
  const bool failed = calibration.decision.status == DecisionStatus::fail ||
                      calibration.decision.status == DecisionStatus::conditional_fail;
  document.tone = suspicious || failed ? Tone::warning : Tone::plain;
  document.headline = failed       ? "FAIL"
                      : suspicious ? "Calibrated, residual too large"
                                   : "Calibrated without angles";
  document.summary.push_back(full_stop(calibration.diagnosis.reason));

  add_identification(document, input);
  add_parameters(document, input);
  add_diagnosis(document, calibration);
  document.blocks.push_back(residual_figure(calibration));
  document.blocks.push_back(Heading{"Statement of conformity"});
  const Decision& decision = calibration.decision;
  document.blocks.push_back(Paragraph{
      decision.status == DecisionStatus::none
          ? "No acceptance limit was given; no statement of conformity is made."
          : fmt::format("{}: largest error {} mm/s², limit {} mm/s². {}",
                        to_string(decision.status), milli_mps2(decision.max_abs_error_mps2),
                        milli_mps2(decision.limit_mps2), decision.rule)});
  document.blocks.push_back(Heading{"Data and events"});
  Facts facts;
  facts.rows = {
      {"Program", "plumbline " + program_version()},
      {"Seed", fmt::format("{}", input.provenance.seed)},
      {"Rows skipped",
       calibration.skipped_rows == 0 ? "none" : fmt::format("{}", calibration.skipped_rows)}};
  for (const auto& [name, hash] : input.provenance.input_sha256) {
    facts.rows.push_back({"SHA-256 of " + name, hash});
  }
  document.blocks.push_back(std::move(facts));
  document.colophon =
      "The results relate only to the item calibrated. This certificate may not be reproduced "
      "except in full.";
  return document;
}

}  // namespace plumbline::app
