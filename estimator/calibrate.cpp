#include "estimator/calibrate.h"

#include <Eigen/Core>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "estimator/calibrate_in_noise.h"
#include "estimator/effects/code_evidence.h"
#include "estimator/effects/dwell_line.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/noise/identify.h"
#include "estimator/noise/longest_stretch.h"
#include "estimator/noise/periodic_noise.h"
#include "estimator/noise/record_columns.h"
#include "estimator/noise/reml.h"
#include "estimator/outlying_readings.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

/// Noise of the longest stretch of the record without a gap.
NoiseModel identify_from_record(const SampleTable& table, const Stretch& stretch,
                                std::size_t axis) {
  const auto from = table.u_V[axis].begin() + static_cast<std::ptrdiff_t>(stretch.first);
  std::vector<double> record(from, from + static_cast<std::ptrdiff_t>(stretch.count));
  const std::vector<OutlyingReading> outlying = outlying_readings(record);
  replace(record, outlying);
  std::string followed;
  for (const std::string& column : take_out_columns(record, table, stretch.first, stretch.step_s))
    followed += (followed.empty() ? "" : " and ") + column;
  NoiseModel noise = identify_noise(record, 1.0 / stretch.step_s);
  std::string remark;
  if (!outlying.empty())
    add_remark(remark, std::to_string(outlying.size()) +
                           " outlying readings of the static record were left out");
  if (!followed.empty())
    add_remark(remark, "what follows " + followed + " in the static record is not noise");
  if (stretch.gaps > 0)
    add_remark(remark, "the static record has " + std::to_string(stretch.gaps) +
                           " gaps; its longest stretch of " + std::to_string(stretch.count) +
                           " samples was used");
  if (!noise.remark.empty()) add_remark(remark, noise.remark);
  noise.remark = std::move(remark);
  return noise;
}

/// stretch: of the static record, if there is one.
NoiseModel identify(const CalibrationInput& input, const Stretch& stretch, std::size_t axis) {
  const SampleTable* record = input.static_record;
  return record != nullptr && record->size() > 1
             ? identify_from_record(*record, stretch, axis)
             : identify_noise_from_bursts(input.run.samples, input.run.poses, axis);
}

PreparedRun prepared(const CalibrationInput& input) {
  constexpr double kStepWithoutRecord_s = 1e-3;
  const Stretch stretch =
      input.static_record ? longest_stretch(input.static_record->t_s) : Stretch{};
  std::vector<PoseMean> poses = pose_means(input.run);
  Eigen::MatrixXd A = design_matrix(poses, input.description.gravity);
  PreparedRun run{input,
                  std::move(poses),
                  pose_windows(input.run.samples, input.run.poses,
                               stretch.step_s > 0 ? stretch.step_s : kStepWithoutRecord_s),
                  std::move(A),
                  {}};
  parallel_for(kAxisCount,
               [&](std::size_t axis) { run.noise[axis] = identify(input, stretch, axis); });
  return run;
}

/// Whether a line of the record runs through all dwells with one phase and nearly as strong: what
/// wanders does not.
bool goes_on(const SpectralLine& line, const MeasurementSet& run, std::size_t axis,
             const SampleWindow& dwell) {
  constexpr double kNearly = 0.8, kPeriods = 1;  // more, or fewer, in a dwell
  const auto through = line_through_dwells(run, axis);
  if (!through || through->amplitude_V < kNearly * line.amplitude) return false;
  const double apart_hz = alias_hz(through->f_hz, dwell.step_s) - alias_hz(line.f_hz, dwell.step_s);
  return std::abs(apart_hz) * dwell.duration_s() < kPeriods;
}

/// Whether another kind of noise might lead elsewhere: a line that wanders is found as many things
/// where it is no noise, and where it is, a steady one hides in it.
bool leaves_open(const Calibration& result, const MeasurementSet& run,
                 const FurtherNoise& further) {
  if (result.observability.rank < 4) return false;
  if (further.bands.empty())
    return !result.diagnosis.effects.empty() || !result.diagnosis.unlisted.empty();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    Eigen::VectorXd left(std::ssize(result.pose_results));  // of any unit
    for (Eigen::Index k = 0; k < left.size(); ++k)
      left(k) = result.pose_results[static_cast<std::size_t>(k)].residual_after_mps2[axis];
    if (line_through_dwells(run, axis) || line_between_dwells(run, left)) return true;
  }
  return false;
}

/// Whether a run is explained better by what was found in further noise than by what was found
/// `without` it.
bool is_better(const Calibration& in_further_noise, const Calibration& without) {
  return in_further_noise.schwarz_criterion < without.schwarz_criterion - kPriceOfFurtherNoise;
}

/// Of the two kinds of noise that the means may have, the one in which Schwarz's criterion is the
/// smaller; the less likely of them is tried only where the other leaves the question open.
struct InItsNoise {
  FurtherNoise further;
  Calibration result;
};
InItsNoise calibrate_in_likeliest(const PreparedRun& run, const CalibrationOptions& options) {
  PerAxis<Eigen::VectorXd> mean_V;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    mean_V[axis] = mean_voltages(run.poses, axis);
  const std::vector<FurtherNoise> noises = possible_noises(
      run.noise, run.windows, mean_V, run.A, [&](std::size_t axis, const SpectralLine& line) {
        return goes_on(line, run.input.run, axis, run.windows.front());
      });
  const FurtherNoise& first = noises.front();
  InItsNoise chosen{first, calibrate_in_noise(first, run, options)};
  if (noises.size() > 1 && leaves_open(chosen.result, run.input.run, first)) {
    Calibration other = calibrate_in_noise(noises.back(), run, options);
    if (first.bands.empty() ? is_better(other, chosen.result) : !is_better(chosen.result, other))
      chosen = {noises.back(), std::move(other)};
  }
  return chosen;
}

}  // namespace

Calibration calibrate(const CalibrationInput& given, const CalibrationOptions& options) {
  assert(given.run.has_angles && !given.run.poses.empty());
  RunDescription description = given.description;
  if (description.adc) description.adc = aligned_with(given.run.samples, *description.adc);
  MeasurementSet measured = given.run;
  const PerAxis<std::size_t> outlying = replace_outlying(measured, description.adc);
  const CalibrationInput input{measured, given.static_record, description};
  const PreparedRun run = prepared(input);
  InItsNoise decided = calibrate_in_likeliest(run, options);
  // Decided again only then: what follows a column does so while the record is taken, too, and
  // would hide in noise as smooth as that.
  const std::vector<UnlistedStructure>& unlisted = decided.result.diagnosis.unlisted;
  if (std::any_of(unlisted.begin(), unlisted.end(),
                  [](const UnlistedStructure& found) { return found.follows_the_time(); }) &&
      records_show_smooth_noise(run.noise, run.windows)) {
    decided.further.smooth = true;
    Calibration smooth = calibrate_in_noise(decided.further, run, options);
    if (is_better(smooth, decided.result)) decided.result = std::move(smooth);
  }
  decided.result.outlying_readings = outlying;
  return std::move(decided.result);
}

}  // namespace plumbline
