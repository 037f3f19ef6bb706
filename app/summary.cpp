#include "app/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/certificate/rounding.h"
#include "estimator/decision.h"
#include "estimator/parameter_name.h"
#include "estimator/shifted_parameters.h"

namespace plumbline::app {

namespace {

constexpr double kCoverageFactor = 2;
constexpr double kMilli = 1e3;

std::string unit_name(const RunDescription& description) {
  return description.dut.serial.empty() ? "The unit" : "Unit " + description.dut.serial;
}

/// Pads by what is seen: "±" and "²" are two bytes and one column.
std::string right_aligned(const std::string& text, std::size_t width) {
  const auto columns = static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
  return columns >= width ? text : std::string(width - columns, ' ') + text;
}

/// Where the noise was identified; an axis that always read one code shows none.
std::string noise_source_words(const PerAxis<NoiseModel>& noise) {
  std::string source, silent;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (noise[axis].source == "none")
      silent += fmt::format("{}{}", silent.empty() ? "" : ", ", kAxisName[axis]);
    else if (source.empty())
      source = "noise from the " + noise[axis].source;
  }
  if (source.empty()) return "no noise to be seen";
  return silent.empty() ? source : source + ", none to be seen on " + silent;
}

/// Nothing where there are none.
std::string outlying_readings_line(const PerAxis<std::size_t>& outlying) {
  std::string text;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (outlying[axis] > 0)
      text += fmt::format("{}{} of {}", text.empty() ? "" : ", ",
                          counted(outlying[axis], "reading"), kAxisName[axis]);
  return text.empty() ? text : "left out, far out of their pose: " + text + '\n';
}

std::string parameter_rows(const TriadEstimate& estimate) {
  std::string rows = "parameters, ± with k = 2:";
  for (const char* title : {"K_x mV/g", "K_y mV/g", "K_z mV/g", "U_0 mV"}) {
    rows += right_aligned(title, rows.size() < 30 ? 20 : 23);
  }
  rows += '\n';
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    rows += fmt::format("  {}    ", kAxisName[axis]);
    for (Eigen::Index i = 0; i < 4; ++i) {
      const double u = std::sqrt(std::max(0.0, estimate[axis].covariance(i, i)));
      const RoundedResult rounded =
          round_result(kMilli * estimate[axis].value[i], kMilli * kCoverageFactor * u);
      rows += right_aligned(rounded.value + " ± " + rounded.uncertainty, i == 0 ? 38 : 23);
    }
    rows += '\n';
  }
  return rows;
}

std::string error_row(const char* label, const PerAxis<double>& values) {
  std::string row = fmt::format("  {:<44}", label);
  for (const double value : values) row += right_aligned(significant(kMilli * value, 3), 9);
  return row + '\n';
}

std::string error_header() {
  return fmt::format("{:<46}{:>9}{:>9}{:>9}\n", "error of a pose mean, mm/s² rms:", "x", "y", "z");
}

std::string error_rows(const Calibration& calibration,
                       const std::optional<Evaluation>& verification) {
  std::string rows = error_header();
  rows += error_row("twelve parameters, poses left out of the fit",
                    calibration.before.heldout_pose_rms_mps2);
  if (calibration.diagnosis.enlarges_model()) {
    rows += error_row("with the added effects, poses left out",
                      calibration.after.heldout_pose_rms_mps2);
  }
  rows += error_row("what the noise alone would leave", calibration.floor_pose_rms_mps2);
  if (verification) {
    rows += error_row(
        fmt::format("{} off the grid", counted(verification->poses, "fresh pose")).c_str(),
        verification->after.pose_rms_mps2);
  }
  return rows;
}

/// Nothing where there are none.
std::string shifted_line(const Calibration& calibration) {
  std::string text;
  for (const ShiftedParameter& p : shifted_parameters(calibration)) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", parameter_name(p.axis, p.column),
                        significant(std::abs(p.in_expanded_u()), 2));
  }
  return text.empty() ? text : "changed by the added effects, in multiples of U: " + text + '\n';
}

std::string verdict_words(const Calibration& calibration) {
  const std::size_t axis =
      axis_standing_out(calibration.after.heldout_pose_rms_mps2, calibration.floor_pose_rms_mps2);
  const std::string residual =
      fmt::format("{} axis: {} m/s² rms where the noise alone would leave {}", kAxisName[axis],
                  significant(calibration.after.heldout_pose_rms_mps2[axis], 2),
                  significant(calibration.floor_pose_rms_mps2[axis], 2));
  switch (calibration.diagnosis.verdict) {
    case Verdict::clean:
      return fmt::format("is calibrated and the model is complete within the noise ({})", residual);
    case Verdict::explained:
      return fmt::format("is calibrated, its residual is explained ({})", residual);
    case Verdict::partly_explained:
      return fmt::format("is calibrated, but its residual is explained only in part ({})",
                         residual);
    case Verdict::unexplained:
      return fmt::format("is calibrated, but the model lacks something ({})", residual);
    case Verdict::undetermined:
      break;
  }
  return fmt::format("is calibrated; whether the model is complete cannot be told ({})",
                     calibration.diagnosis.reason);
}

}  // namespace

std::string counted(std::size_t count, const char* singular) {
  return fmt::format("{} {}{}", count, singular, count == 1 ? "" : "s");
}

std::string conclusion(const RunDescription& description, const Calibration& calibration,
                       const std::optional<Evaluation>& verification) {
  std::string text = unit_name(description) + " " + verdict_words(calibration);
  if (verification) {
    const auto& errors = verification->after.pose_max_abs_mps2;
    const std::string poses = counted(verification->poses, "fresh pose");
    const bool one = verification->poses == 1;
    const double largest_mps2 = *std::max_element(errors.begin(), errors.end());
    if (const auto axis = contradicted_axis(calibration, *verification)) {
      text += fmt::format(
          "; but {} do{} not confirm it: {} axis {} m/s² rms where the noise alone would leave "
          "{}, largest error {} m/s²",
          poses, one ? "es" : "", kAxisName[*axis],
          significant(verification->after.pose_rms_mps2[*axis], 2),
          significant(calibration.floor_pose_rms_mps2[*axis], 2), significant(largest_mps2, 2));
    } else {
      text += fmt::format("; {} confirm{} it to {} m/s²", poses, one ? "s" : "",
                          significant(largest_mps2, 2));
    }
  }
  const Decision& decision = calibration.decision;
  if (decision.status != DecisionStatus::none) {
    text += fmt::format("; {}: largest error {} m/s², limit {} m/s²", to_words(decision.status),
                        significant(decision.max_abs_error_mps2, 2),
                        significant(decision.limit_mps2, 3));
  }
  return text + ".";
}

std::string summary(const RunDescription& description, const Calibration& calibration,
                    const std::optional<Evaluation>& verification) {
  std::string text =
      fmt::format("{}: {}, {}{}; {}\n", unit_name(description), counted(calibration.poses, "pose"),
                  counted(calibration.samples, "sample"),
                  calibration.skipped_rows == 0
                      ? ""
                      : fmt::format(", {} skipped", counted(calibration.skipped_rows, "bad row")),
                  noise_source_words(calibration.noise));
  text += outlying_readings_line(calibration.outlying_readings);
  text += parameter_rows(calibration.final.batch_ls);
  text += error_rows(calibration, verification);
  text += fmt::format("diagnosis: {}: {}\n", to_string(calibration.diagnosis.verdict),
                      calibration.diagnosis.reason);
  text += shifted_line(calibration);
  for (const auto& [name, ambiguity] : calibration.diagnosis.findings()) {
    if (!ambiguity.separate_by.empty())
      text += fmt::format("to tell {} apart: {}{}\n", name, ambiguity.separate_by,
                          ambiguity.separating_plan.stops.empty() ? "" : " (separate.csv)");
  }
  const Decision& decision = calibration.decision;
  const bool withheld = decision.status == DecisionStatus::none && decision.limit_mps2 > 0;
  text += fmt::format("decision: {}\n",
                      withheld ? "NONE, THE RUN WAS NOT FINISHED" : to_words(decision.status));
  return text + conclusion(description, calibration, verification) + "\n";
}

std::string caution(const std::vector<std::string>& lacking,
                    const std::vector<std::string>& left_out) {
  if (lacking.empty()) return {};
  return fmt::format("caution: the readings have no {}; left out: {}", fmt::join(lacking, ", "),
                     fmt::join(left_out, ", "));
}

std::string caution(const BeyondRange& column) {
  return fmt::format("caution: {} from {} to {}, calibrated from {} to {} ({} beyond)",
                     column.seen.column, significant(column.seen.low, 4),
                     significant(column.seen.high, 4), significant(column.calibrated.low, 4),
                     significant(column.calibrated.high, 4), counted(column.readings, "reading"));
}

std::string evaluation_summary(const Evaluation& evaluation, const std::optional<Limits>& limits) {
  std::string text = error_header();
  text += error_row("twelve parameters", evaluation.before.pose_rms_mps2);
  text += error_row("certified model", evaluation.after.pose_rms_mps2);
  text += error_row("certified model, largest", evaluation.after.pose_max_abs_mps2);
  const auto& errors = evaluation.after.pose_max_abs_mps2;
  const double largest = *std::max_element(errors.begin(), errors.end());
  text += fmt::format("The calibration reproduces {} to {} m/s² at worst",
                      counted(evaluation.poses, "pose"), significant(largest, 2));
  if (limits) {
    text +=
        fmt::format("; {}: limit {} m/s²", largest <= limits->max_abs_error_mps2 ? "PASS" : "FAIL",
                    significant(limits->max_abs_error_mps2, 3));
  }
  text += ".\n";
  text += outlying_readings_line(evaluation.outlying_readings);
  if (!evaluation.left_out.empty()) {
    text += fmt::format(
        "Not applied, as it belonged to the calibration run, this set lacks a column, or another "
        "version found it: {}.\n",
        fmt::join(evaluation.left_out, ", "));
  }
  if (auto lack = caution(evaluation.lacking, evaluation.left_out); !lack.empty())
    text += lack + '\n';
  for (const BeyondRange& column : evaluation.beyond) text += caution(column) + '\n';
  if (!evaluation.decided_otherwise.empty()) {
    text += fmt::format(
        "The calibration run left open which way the head goes; these poses tell: {}.\n",
        fmt::join(evaluation.decided_otherwise, ", "));
  }
  return text;
}

}  // namespace plumbline::app
