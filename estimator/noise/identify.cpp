#include "estimator/noise/identify.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include "estimator/noise/allan.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/noise/line_search.h"
#include "estimator/noise/misfit.h"
#include "estimator/noise/record_terms.h"
#include "estimator/noise/term_choice.h"
#include "estimator/noise/term_fit.h"

namespace plumbline {

namespace {

constexpr std::size_t kFewestSamples = 64;
constexpr std::size_t kFewestChanges = 32;
// Q, N, B, K; the ramp is a trend.
constexpr Eigen::Index kVarianceTerms = kTermR;

NoiseModel undetermined(double rate_hz, const std::string& why) {
  NoiseModel model;
  model.rate_hz = rate_hz;
  model.source = "none";
  model.remark = why;
  return model;
}

NoiseTerm& term(NoiseModel& model, std::size_t index) {
  NoiseTerm* const terms[kTermCount] = {&model.Q, &model.N, &model.B, &model.K, &model.R};
  return *terms[index];
}

/// Covariance of the powers that are not at zero; the others are held there.
NoisePowerMatrix power_covariance(const NoisePowerMatrix& information, const NoisePowers& power) {
  NoisePowerMatrix covariance = NoisePowerMatrix::Zero();
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < kVarianceTerms; ++i)
    if (power(i) > 0) free.push_back(i);
  if (free.empty()) return covariance;
  const Eigen::MatrixXd reduced = information(free, free);
  const Eigen::VectorXd scale = reduced.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * reduced * scale.asDiagonal();
  covariance(free, free) = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
  return covariance;
}

void fill_terms(const TermFit& fit, NoiseModel& model) {
  const NoisePowerMatrix covariance = power_covariance(fit.information, fit.power);
  for (std::size_t i = 0; i < kTermCount; ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    NoiseTerm& t = term(model, i);
    t.value = std::sqrt(fit.power(index));
    t.upper_limit = std::sqrt(fit.upper_power(index));
    t.present = fit.gain(index) > (i == kTermR ? kRampGain : kVarianceGain);
    if (i == kTermR)
      t.u = fit.ramp_u;
    else if (t.value > 0)
      t.u = std::sqrt(covariance(index, index)) / (2 * t.value);
    else
      t.u = t.upper_limit / 1.645;  // half-normal about zero with the same upper limit
  }
  for (Eigen::Index i = 0; i < kVarianceTerms; ++i)
    for (Eigen::Index j = 0; j < kVarianceTerms; ++j)
      if (covariance(i, i) > 0 && covariance(j, j) > 0)
        model.correlation(i, j) = covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j));
  if (model.R.u > 0) model.correlation(kTermR, kTermR) = 1;
  model.spectrum = fit.spectrum;
  model.walk_decay_per_s = fit.walk_decay_per_s;
  model.descriptions = fit.descriptions;
}

}  // namespace

NoisePowers noise_powers(const NoiseModel& model) {
  NoisePowers power;
  power << model.Q.value * model.Q.value, model.N.value * model.N.value,
      model.B.value * model.B.value, model.K.value * model.K.value,
      model.R.present ? model.R.value * model.R.value : 0.0;
  return power;
}

std::array<NoiseTerm, kTermCount> reported_terms(const NoiseModel& model) {
  if (model.record.dof > 0) return model.record.term;
  return {model.Q, model.N, model.B, model.K, model.R};
}

NoiseModel identify_noise(const std::vector<double>& record, double rate_hz) {
  if (!(rate_hz > 0) || !std::isfinite(rate_hz))
    return undetermined(0, "the sampling rate is not known");
  for (std::size_t i = 0; i < record.size(); ++i)
    if (!std::isfinite(record[i]))
      return undetermined(rate_hz, "sample " + std::to_string(i) + " is not a finite number");
  if (record.size() < kFewestSamples)
    return undetermined(rate_hz, "too short: " + std::to_string(record.size()) + " samples, " +
                                     std::to_string(kFewestSamples) + " are needed");
  std::size_t changes = 0;
  for (std::size_t i = 1; i < record.size(); ++i) changes += record[i] != record[i - 1] ? 1 : 0;
  if (changes == 0) return undetermined(rate_hz, "constant: no noise to be seen");
  if (changes < kFewestChanges)
    return undetermined(rate_hz, "nearly constant: its value changes " + std::to_string(changes) +
                                     " times, the noise is below its step");

  const LineSearch search = find_lines(record, rate_hz);
  NoiseModel model;
  model.rate_hz = rate_hz;
  model.source = "static record";
  model.mean =
      std::accumulate(record.begin(), record.end(), 0.0) / static_cast<double>(record.size());
  model.record = describe_record(search, record, rate_hz);
  const bool rolls_off = model.record.band_hz < 0.49 * rate_hz;
  const TermFit fit = fit_terms(
      gather_spectrum(search.spectrum, rate_hz, search.masked,
                      rolls_off ? model.record.band_hz : std::numeric_limits<double>::infinity()));
  fill_terms(fit, model);
  model.oadev = deviation_curve(Deviation::oadev, integrate_record(record, rate_hz), rate_hz);
  for (const double tau : model.oadev.tau_s)
    model.fitted.push_back(allan_deviation_of(model.record, tau));
  model.chi2 = fit.chi2;
  model.dof = fit.dof;
  model.p_value = chi_squared_tail(fit.chi2, fit.dof);
  model.adequate =
      fit.converged && model.p_value > kInadequate && search.lines.empty() && !rolls_off;
  model.remark = model.record.remark;
  if (model.remark.empty() && !fit.converged)
    model.remark = "the fit of the noise terms did not converge";
  if (model.remark.empty() && !model.adequate)
    model.remark = "the five terms do not describe the spectrum of this record";
  return model;
}

NoiseModel identify_noise_from_bursts(const SampleTable& samples, const std::vector<Pose>& poses,
                                      std::size_t axis) {
  assert(axis < kAxisCount);
  const std::vector<double>& u = samples.u_V[axis];
  double square = 0;
  double dof = 0;
  double time = 0;
  double steps = 0;
  for (const Pose& pose : poses) {
    if (pose.count < 2) continue;
    double mean = 0;
    for (std::size_t i = pose.first; i < pose.first + pose.count; ++i) mean += u[i] - u[pose.first];
    mean = u[pose.first] + mean / static_cast<double>(pose.count);
    for (std::size_t i = pose.first; i < pose.first + pose.count; ++i)
      square += (u[i] - mean) * (u[i] - mean);
    dof += static_cast<double>(pose.count - 1);
    time += samples.t_s[pose.first + pose.count - 1] - samples.t_s[pose.first];
    steps += static_cast<double>(pose.count - 1);
  }
  if (dof == 0 || !(time > 0)) return undetermined(0, "no pose has two samples");
  const double rate_hz = steps / time;
  if (!(square > 0))
    return undetermined(rate_hz, "the samples within every pose are equal: noise below one step");
  NoiseModel model;
  model.rate_hz = rate_hz;
  model.source = "bursts at the poses";
  model.remark = "white noise from the scatter within the poses; slow noise left to the run";
  model.N.value = std::sqrt(square / dof / rate_hz);
  model.N.u = model.N.value / std::sqrt(2 * dof);
  model.N.present = true;
  model.N.upper_limit = model.N.value + 1.645 * model.N.u;
  model.spectrum.push_back(
      {.count = dof, .square = square, .density = Eigen::Vector4d(0, rate_hz, 0, 0)});
  model.correlation(kTermN, kTermN) = 1;
  model.adequate = true;
  return model;
}

}  // namespace plumbline
