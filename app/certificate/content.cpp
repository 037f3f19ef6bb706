#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "app/certificate/certificate.h"
#include "app/certificate/figures.h"
#include "app/certificate/rounding.h"

namespace plumbline::app {
namespace {

constexpr double kCoverageFactor = 2;

std::string parameter_name(std::size_t axis, Eigen::Index column) {
  return column == 3
             ? fmt::format("U_{}0", kAxisName[axis])
             : fmt::format("K_{}{}", kAxisName[axis], kAxisName[static_cast<std::size_t>(column)]);
}

double scale_mps2(const Calibration& calibration, std::size_t axis) {
  return kStandardGravity_mps2 /
         std::abs(calibration.final.batch_ls[axis].value(static_cast<Eigen::Index>(axis)));
}

std::string milli_mps2(double value_mps2) { return significant(1e3 * value_mps2, 3); }

std::string status_words(DecisionStatus status) {
  switch (status) {
    case DecisionStatus::pass:
      return "PASS";
    case DecisionStatus::conditional_pass:
      return "CONDITIONAL PASS";
    case DecisionStatus::conditional_fail:
      return "CONDITIONAL FAIL";
    case DecisionStatus::fail:
      return "FAIL";
    case DecisionStatus::none:
      break;
  }
  return "NO LIMIT STATED";
}

/// A reason as it stands in a certificate: capital letter, full stop.
std::string sentence(std::string text) {
  if (text.empty()) return text;
  // An effect's id at the beginning stays as it is written.
  const std::size_t word = text.find(' ');
  if (text.substr(0, word).find('.') == std::string::npos) {
    text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  }
  if (text.back() != '.') text += '.';
  return text;
}

void add_identification(Document& document, const CertificateInput& input) {
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
       fmt::format("multipoint tumble test in the field of gravity on a two-axis dividing head, {} "
                   "positions, {} readings; estimated by weighted least squares, recursive least "
                   "squares and an eight-state Kalman filter",
                   input.calibration.poses, input.calibration.samples)},
      {"Local gravity",
       run.gravity.u_mps2 > 0
           ? fmt::format("g = {}, k = 2",
                         result_with_unit(run.gravity.local_mps2, 2 * run.gravity.u_mps2, "m/s²"))
           : fmt::format("g = {} m/s²; uncertainty not stated",
                         significant(run.gravity.local_mps2, 7))},
      {"Positioning of the head",
       fmt::format("standard uncertainty {}″ in δ and {}″ in h",
                   significant(run.angles.delta_arcsec, 3), significant(run.angles.h_arcsec, 3))},
      {"Converter",
       run.adc ? fmt::format("{} bits from {} V to {} V, step {} µV", run.adc->bits, run.adc->min_V,
                             run.adc->max_V, significant(1e6 * run.adc->lsb_V(), 4))
               : "not described; nothing is assumed about quantization"},
      {"Reference temperature", fmt::format("{} °C", significant(run.reference_C, 3))},
      {"Traceability of the angles and of g", ""},
      {"Authorised by", ""}};
  double low = INFINITY, high = -INFINITY;
  for (const PoseResult& pose : input.calibration.pose_results) {
    if (!std::isfinite(pose.temp_C)) continue;
    low = std::min(low, pose.temp_C);
    high = std::max(high, pose.temp_C);
  }
  const auto place = facts.rows.end() - 2;
  facts.rows.insert(place, {"Temperature during the run",
                            low <= high ? fmt::format("{:.1f} °C to {:.1f} °C", low, high) : ""});
  document.blocks.push_back(std::move(facts));
}

void add_parameters(Document& document, const Calibration& calibration) {
  document.blocks.push_back(Heading{"Results"});
  document.blocks.push_back(Paragraph{
      "Output voltage of axis i:  U_i = K_ix·a_x + K_iy·a_y + K_iz·a_z + U_i0, with the specific "
      "force a in the frame of the triad in units of g_n = 9.80665 m/s². Expanded uncertainties "
      "with coverage factor k = 2 (about 95 %)."});
  Table table;
  table.caption = "Calibrated parameters (weighted least squares)";
  table.header = {"axis i",     "K_ix, mV/g", "U",        "K_iy, mV/g", "U",
                  "K_iz, mV/g", "U",          "U_i0, mV", "U"};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    std::vector<std::string> row = {kAxisName[i]};
    const AxisEstimate& estimate = calibration.final.batch_ls[i];
    for (Eigen::Index j = 0; j < 4; ++j) {
      const RoundedResult rounded = round_result(
          1e3 * estimate.value(j), 1e3 * kCoverageFactor * std::sqrt(estimate.covariance(j, j)));
      row.push_back(rounded.value);
      row.push_back(rounded.uncertainty);
    }
    table.rows.push_back(std::move(row));
  }
  document.blocks.push_back(std::move(table));

  Table methods;
  methods.caption = "Agreement of the estimators: difference from weighted least squares";
  methods.header = {"parameter", "least squares, mV/g (mV)", "recursive − batch", "filter − batch",
                    "U of batch"};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      const AxisEstimate& batch = calibration.estimates.batch_ls[i];
      const double expanded = 1e3 * kCoverageFactor * std::sqrt(batch.covariance(j, j));
      const RoundedResult rounded = round_result(1e3 * batch.value(j), expanded);
      const auto difference = [&](const AxisEstimate& other) {
        return significant(1e3 * (other.value(j) - batch.value(j)), 2);
      };
      methods.rows.push_back(
          {parameter_name(i, j), rounded.value,
           calibration.estimates.rls ? difference((*calibration.estimates.rls)[i]) : "–",
           difference(calibration.estimates.ekf[i]), rounded.uncertainty});
    }
  }
  document.blocks.push_back(std::move(methods));
  const auto& en = calibration.estimates.agreement_en;
  document.blocks.push_back(Paragraph{fmt::format(
      "Largest E_n number between filter and least squares: x {}, y {}, z {} (agreement "
      "up to 1).",
      significant(en[0], 2), significant(en[1], 2), significant(en[2], 2))});
}

void add_errors(Document& document, const CertificateInput& input) {
  const Calibration& calibration = input.calibration;
  document.blocks.push_back(Heading{"Error of the calibrated model"});
  Table table;
  table.caption = "Input-referred errors, mm/s²";
  table.header = {"", "x", "y", "z"};
  const auto row = [&](const char* label, const PerAxis<double>& values) {
    table.rows.push_back(
        {label, milli_mps2(values[0]), milli_mps2(values[1]), milli_mps2(values[2])});
  };
  row("RMS of the pose means, fitted poses", calibration.after.fit_pose_rms_mps2);
  row("RMS of the pose means, poses left out of the fit", calibration.after.heldout_pose_rms_mps2);
  row("largest pose mean, poses left out of the fit", calibration.after.heldout_pose_max_abs_mps2);
  if (input.verification != nullptr) {
    row("RMS of the pose means, fresh verification poses", input.verification->after.pose_rms_mps2);
    row("largest pose mean, fresh verification poses", input.verification->after.pose_max_abs_mps2);
  }
  row("RMS of single readings", calibration.after.sample_rms_mps2);
  row("expected RMS of the pose means from the noise alone", calibration.floor_pose_rms_mps2);
  row("   its standard uncertainty", calibration.u_floor_pose_rms_mps2);
  document.blocks.push_back(std::move(table));

  const Diagnosis& diagnosis = calibration.diagnosis;
  document.blocks.push_back(
      Paragraph{fmt::format("Residual {}. {} p = {} for noise alone.", to_string(diagnosis.verdict),
                            sentence(diagnosis.reason), significant(diagnosis.p_value, 2)),
                diagnosis.verdict == Verdict::unexplained ? Tone::warning : Tone::plain});
}

void add_effects(Document& document, const Diagnosis& diagnosis) {
  if (diagnosis.effects.empty() && diagnosis.unlisted.empty()) return;
  Table table;
  table.caption = "Effects found in the residual and added to the model";
  table.header = {"effect", "axes", "parameters", "p-value", "could also be"};
  const auto axes_text = [](const std::vector<std::size_t>& axes) {
    std::string text;
    for (std::size_t axis : axes) text += (text.empty() ? "" : ", ") + std::string(kAxisName[axis]);
    return text;
  };
  for (const FoundEffect& effect : diagnosis.effects) {
    std::string parameters, alternatives;
    for (const EffectParameter& p : effect.parameters) {
      parameters += (parameters.empty() ? "" : "; ") + p.name + " = " +
                    result_with_unit(p.value, kCoverageFactor * p.u, p.unit);
    }
    for (const std::string& other : effect.alternatives) {
      alternatives += (alternatives.empty() ? "" : "; ") + other;
    }
    table.rows.push_back({effect.id, axes_text(effect.axes), parameters,
                          significant(effect.p_value, 2), alternatives});
  }
  for (const UnlistedStructure& found : diagnosis.unlisted) {
    table.rows.push_back({fmt::format("unlisted, driven by {}", found.driver),
                          axes_text(found.axes), fmt::format("{}: {}", found.form, found.shape),
                          significant(found.p_value, 2), ""});
  }
  document.blocks.push_back(std::move(table));
}

void add_noise(Document& document, const Calibration& calibration) {
  Table table;
  table.caption =
      "Identified noise, input-referred, with standard uncertainties; “<” gives the 95 % upper "
      "limit of a term that is not present";
  table.header = {"axis",       "Q, m/s",  "N, m/s/√s", "B, m/s²",
                  "K, m/s²/√s", "R, m/s³", "fit",       "source"};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const NoiseModel& noise = calibration.noise[i];
    const double scale = scale_mps2(calibration, i);
    const auto term = [&](const NoiseTerm& t) {
      if (noise.source == "none") return std::string("–");
      if (!t.present) {
        return t.upper_limit > 0 ? "< " + significant(t.upper_limit * scale, 2) : std::string("–");
      }
      return fmt::format("{} ± {}", significant(t.value * scale, 3), significant(t.u * scale, 1));
    };
    table.rows.push_back({kAxisName[i], term(noise.Q), term(noise.N), term(noise.B), term(noise.K),
                          term(noise.R),
                          noise.source == "none" ? "–"
                          : noise.adequate       ? "adequate"
                                                 : "not adequate",
                          noise.source});
  }
  document.blocks.push_back(std::move(table));
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    if (calibration.noise[i].remark.empty()) continue;
    document.blocks.push_back(Paragraph{
        fmt::format("Noise of the {} axis: {}.", kAxisName[i], calibration.noise[i].remark),
        Tone::note});
  }
}

void add_decision(Document& document, const Decision& decision) {
  document.blocks.push_back(Heading{"Statement of conformity"});
  if (decision.status == DecisionStatus::none) {
    document.blocks.push_back(
        Paragraph{"No acceptance limit was given; no statement of conformity is made."});
    return;
  }
  Facts facts;
  facts.rows = {{"Decision", status_words(decision.status)},
                {"Limit", fmt::format("largest error {} mm/s²", milli_mps2(decision.limit_mps2))},
                {"Measured",
                 fmt::format("largest error {} mm/s², standard uncertainty {} mm/s²",
                             milli_mps2(decision.max_abs_error_mps2), milli_mps2(decision.u_mps2))},
                {"Guard band", fmt::format("{} mm/s²", milli_mps2(decision.guard_band_mps2))},
                {"Decision rule", decision.rule}};
  document.blocks.push_back(std::move(facts));
}

void add_history(Document& document, const CertificateInput& input) {
  document.blocks.push_back(Heading{"Data and events"});
  Facts facts;
  facts.rows = {{"Program", "plumbline " + program_version()},
                {"Seed", fmt::format("{}", input.provenance.seed)},
                {"Rows skipped", input.calibration.skipped_rows == 0
                                     ? "none"
                                     : fmt::format("{}", input.calibration.skipped_rows)}};
  for (const auto& [name, hash] : input.provenance.input_sha256) {
    facts.rows.push_back({"SHA-256 of " + name, hash});
  }
  document.blocks.push_back(std::move(facts));
  if (input.events.empty()) return;
  Table table;
  table.caption = "Events of the run";
  table.header = {"time, s", "kind", "what happened"};
  for (const CertificateEvent& event : input.events) {
    table.rows.push_back({significant(event.t_s, 5), event.kind, event.text});
  }
  document.blocks.push_back(std::move(table));
}

}  // namespace

std::string certificate_id(const Provenance& provenance) {
  std::string date = provenance.created_utc.substr(0, 10);
  std::erase(date, '-');
  const std::string hash =
      provenance.input_sha256.empty() ? "" : provenance.input_sha256.front().second.substr(0, 8);
  return fmt::format("PL-{}-{}-{}", provenance.dut.serial, date, hash);
}

Document make_certificate(const CertificateInput& input) {
  const Calibration& calibration = input.calibration;
  Document document;
  document.title = "Calibration certificate";
  document.subtitle =
      fmt::format("Accelerometer triad, serial number {}", input.description.dut.serial);
  document.id = certificate_id(input.provenance);

  const Diagnosis& diagnosis = calibration.diagnosis;
  const bool out_of_limits = calibration.decision.status == DecisionStatus::fail ||
                             calibration.decision.status == DecisionStatus::conditional_fail;
  const bool suspicious =
      diagnosis.verdict == Verdict::unexplained || diagnosis.verdict == Verdict::partly_explained;
  document.tone = out_of_limits || suspicious ? Tone::warning : Tone::plain;
  document.headline = calibration.decision.status == DecisionStatus::none
                          ? (suspicious ? "Calibrated, residual too large" : "Calibrated")
                          : status_words(calibration.decision.status);
  document.summary.push_back(sentence(diagnosis.reason));
  const auto worst = [](const PerAxis<double>& v) { return *std::max_element(v.begin(), v.end()); };
  if (input.verification != nullptr) {
    document.summary.push_back(fmt::format(
        "On {} fresh poses the error is at most {} mm/s² RMS per axis, {} mm/s² at the "
        "single worst pose.",
        input.verification->poses, milli_mps2(worst(input.verification->after.pose_rms_mps2)),
        milli_mps2(worst(input.verification->after.pose_max_abs_mps2))));
  }

  add_identification(document, input);
  add_parameters(document, calibration);
  add_errors(document, input);
  add_effects(document, diagnosis);
  document.blocks.push_back(residual_map(calibration, input.description.grid));
  document.blocks.push_back(residual_histogram(calibration));
  document.blocks.push_back(residual_course(calibration));
  document.blocks.push_back(convergence_figure(calibration));
  document.blocks.push_back(Heading{"Noise"});
  add_noise(document, calibration);
  document.blocks.push_back(allan_figure(calibration));
  add_decision(document, calibration.decision);
  add_history(document, input);
  document.colophon =
      "The results relate only to the item calibrated. This certificate may not be reproduced "
      "except in full.";
  return document;
}

}  // namespace plumbline::app
