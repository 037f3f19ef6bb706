#include "app/scalar_summary.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/certificate/rounding.h"

namespace plumbline::app {

namespace {

constexpr double kCoverageFactor = 2;
constexpr double kMilli = 1e3;

std::string result(double value, double u, const std::string& unit) {
  const RoundedResult rounded = round_result(value, kCoverageFactor * u);
  return rounded.value + " ± " + rounded.uncertainty + " " + unit;
}

std::string conclusion(const std::string& serial, const ScalarCalibration& calibration) {
  const std::string unit = serial.empty() ? "The unit" : "Unit " + serial;
  const std::string size = fmt::format("{} mm/s² rms where the noise inside the rests leaves {}",
                                       significant(kMilli * calibration.residual_rms_mps2, 3),
                                       significant(kMilli * calibration.expected_rms_mps2, 2));
  switch (calibration.diagnosis.verdict) {
    case Verdict::clean:
      return fmt::format(
          "{} is calibrated without angles and the model is complete within the "
          "noise (|a| − g: {})",
          unit, size);
    case Verdict::explained:
      return fmt::format("{} is calibrated without angles, its residual is explained (|a| − g: {})",
                         unit, size);
    case Verdict::partly_explained:
      return fmt::format(
          "{} is calibrated without angles, but its residual is too much and "
          "explained only in part (|a| − g: {}, after {})",
          unit, size, significant(kMilli * calibration.final_residual_rms_mps2, 3));
    case Verdict::unexplained:
      return fmt::format(
          "{} is calibrated without angles, but its residual is too much: the model "
          "lacks something (|a| − g: {})",
          unit, size);
    case Verdict::undetermined:
      break;
  }
  return fmt::format(
      "{} is calibrated without angles; whether the model is complete cannot be "
      "told (|a| − g: {})",
      unit, size);
}

}  // namespace

std::string scalar_summary(const RunDescription& description, const ScalarCalibration& calibration,
                           const ScalarSource& source) {
  std::string text = fmt::format("{} rests, {} samples; {}\n", calibration.intervals,
                                 calibration.samples, source.rests);
  if (calibration.skipped_rows > 0)
    text += fmt::format("{} bad rows skipped\n", calibration.skipped_rows);
  text += "parameters, ± with k = 2:\n";
  const ScalarEstimate& e = calibration.estimate;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    text += fmt::format("  {}: bias {}, scale {}\n", kAxisName[axis],
                        result(e.value(i), e.u(i), source.reading_unit),
                        result(e.value(3 + i), e.u(3 + i), "m/s² per " + source.reading_unit));
  }
  constexpr const char* kAngle[] = {"yz", "zy", "zx"};
  text += "  non-orthogonality:";
  for (Eigen::Index i = 0; i < 3; ++i) {
    text +=
        fmt::format(" {} {}", kAngle[i],
                    result(kMilli * e.value(6 + i), kMilli * e.u(6 + i), i < 2 ? "mrad," : "mrad"));
  }
  text +=
      "\n  (z along its sensitive axis, x perpendicular to those of y and z: |a| does not tell a "
      "rotation of the whole triad)\n";
  if (calibration.head) text += "head: " + calibration.head->words + "\n";
  text += fmt::format("diagnosis: {}: {}\n", to_string(calibration.diagnosis.verdict),
                      calibration.diagnosis.reason);
  if (calibration.decision.status != DecisionStatus::none) {
    text += fmt::format("decision: {} against a limit of {} m/s²\n",
                        to_string(calibration.decision.status),
                        significant(calibration.decision.limit_mps2, 3));
  }
  return text + conclusion(description.dut.serial, calibration) + ".\n";
}

}  // namespace plumbline::app
