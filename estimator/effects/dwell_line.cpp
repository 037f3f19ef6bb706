#include "estimator/effects/dwell_line.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

constexpr std::size_t kFewestSamples = 8;
constexpr Eigen::Index kFewestDwells = 10;
// The search that follows counts the line as one candidate, whose frequency was not looked for, and
// real lines are beyond doubt in thousands of readings.
constexpr double kFalseAlarm = 1e-8;

/// All dwells of one axis, side by side.
struct Dwells {
  Eigen::ArrayXd t_s;       ///< first sample of each, from the first of all
  double origin_s = 0;      ///< of those times, on the clock of the run
  double step_s = 0;        ///< between samples
  double samples = 0;       ///< of all
  Eigen::MatrixXd off_V;    ///< samples × dwells, without mean and without what changes slowly
                            ///< within a dwell; a shorter dwell ends in zeros
  Eigen::MatrixXd removed;  ///< orthonormal functions that the longest was freed of
  double run_s() const { return t_s(t_s.size() - 1); }
};

Dwells dwells_of(const MeasurementSet& set, std::size_t axis) {
  std::vector<const Pose*> poses;
  std::size_t longest = 0;
  for (const Pose& pose : set.poses) {
    if (pose.count < kFewestSamples) continue;
    poses.push_back(&pose);
    longest = std::max(longest, pose.count);
  }
  const std::vector<double>& t_s = set.samples.t_s;
  std::map<std::size_t, Eigen::MatrixXd> slow;
  Dwells dwells;
  if (poses.empty()) return dwells;
  dwells.origin_s = t_s[poses.front()->first];
  dwells.t_s.resize(std::ssize(poses));
  const auto rows = static_cast<Eigen::Index>(longest);
  const Eigen::MatrixXd steps_of_longest = step_contrasts(longest);
  dwells.removed.resize(rows, steps_of_longest.cols() + 1);
  dwells.removed << steps_of_longest,
      Eigen::VectorXd::Constant(rows, 1 / std::sqrt(static_cast<double>(longest)));
  dwells.off_V.setZero(rows, std::ssize(poses));
  double steps = 0, spans_s = 0;
  for (Eigen::Index k = 0; k < dwells.t_s.size(); ++k) {
    const Pose& pose = *poses[static_cast<std::size_t>(k)];
    const auto n = static_cast<Eigen::Index>(pose.count);
    const Eigen::Map<const Eigen::VectorXd> u_V(set.samples.u_V[axis].data() + pose.first, n);
    if (!slow.contains(pose.count)) slow.emplace(pose.count, step_contrasts(pose.count));
    const Eigen::MatrixXd& contrasts = slow.at(pose.count);
    Eigen::VectorXd off_V = u_V.array() - u_V.mean();
    off_V -= contrasts * (contrasts.transpose() * off_V);
    dwells.off_V.col(k).head(n) = off_V;
    dwells.t_s(k) = t_s[pose.first] - dwells.origin_s;
    spans_s += t_s[pose.first + pose.count - 1] - t_s[pose.first];
    steps += static_cast<double>(n - 1);
  }
  dwells.step_s = spans_s / steps;
  dwells.samples = steps + static_cast<double>(poses.size());
  return dwells;
}

/// exp(−2πi·f·t)
Eigen::ArrayXcd turning(double f_hz, const Eigen::ArrayXd& t_s) {
  const Eigen::ArrayXd phase = -effect::kTurn_rad * f_hz * t_s;
  Eigen::ArrayXcd turned(t_s.size());
  turned.real() = phase.cos();
  turned.imag() = phase.sin();
  return turned;
}

/// Σ column·exp(−2πi·f·t) for each column of samples, from the first of them.
Eigen::ArrayXcd along_columns(const Eigen::MatrixXd& columns, double step_s, double f_hz) {
  const Eigen::ArrayXd within_s =
      step_s *
      Eigen::ArrayXd::LinSpaced(columns.rows(), 0, static_cast<double>(columns.rows() - 1));
  const Eigen::VectorXcd turned = turning(f_hz, within_s);
  Eigen::ArrayXcd sums(columns.cols());
  sums.real() = (columns.transpose() * turned.real()).array();
  sums.imag() = (columns.transpose() * turned.imag()).array();
  return sums;
}

/// Σ off·exp(−2πi·f·t) over each dwell.
Eigen::ArrayXcd components(const Dwells& dwells, double f_hz) {
  return along_columns(dwells.off_V, dwells.step_s, f_hz) * turning(f_hz, dwells.t_s);
}

/// Σ |component|² over the columns at 0, 1, 2 … halves of a turn over the length of a column, up
/// to half the sampling rate.
Eigen::ArrayXd power_in_bands(const Eigen::MatrixXd& columns, Eigen::FFT<double>& transform) {
  const auto bands = static_cast<std::size_t>(columns.rows());
  Eigen::ArrayXd power = Eigen::ArrayXd::Zero(columns.rows() + 1);
  std::vector<double> padded(2 * bands);
  std::vector<std::complex<double>> spectrum;
  for (const auto& column : columns.colwise()) {
    std::copy(column.begin(), column.end(), padded.begin());
    transform.fwd(spectrum, padded);
    for (std::size_t k = 0; k <= bands; ++k)
      power(static_cast<Eigen::Index>(k)) += std::norm(spectrum[k]);
  }
  return power;
}

/// Share of a sine of this frequency that is left when what is slow within a dwell is removed.
double share_left(const Dwells& dwells, double f_hz) {
  return 1 - along_columns(dwells.removed, dwells.step_s, f_hz).abs2().sum() /
                 static_cast<double>(dwells.off_V.rows());
}

/// Power of the dwells together at a frequency, as large as if nothing had been removed.
double joint_power(const Dwells& dwells, double f_hz) {
  return std::norm(components(dwells, f_hz).sum()) / share_left(dwells, f_hz);
}

/// The frequency within ±width/2 of `f_hz` at which the dwells together have most power; `f_hz`
/// when nowhere there they agree in phase.
double best_frequency(const Dwells& dwells, double f_hz, double width_hz,
                      Eigen::FFT<double>& transform) {
  // One Fourier transform over the times of the dwells, rounded to slots: an eighth of a turn of
  // phase at most, at the edge of the band.
  const double slot_s = 0.25 / width_hz;
  std::size_t slots = 1;
  while (static_cast<double>(slots) * slot_s < 2 * dwells.run_s()) slots *= 2;
  std::vector<std::complex<double>> in_time(slots), spectrum;
  const Eigen::ArrayXcd parts = components(dwells, f_hz);
  for (Eigen::Index k = 0; k < parts.size(); ++k)
    in_time[static_cast<std::size_t>(std::lround(dwells.t_s(k) / slot_s))] += parts(k);
  transform.fwd(spectrum, in_time);
  const double bin_hz = 1 / (static_cast<double>(slots) * slot_s);
  const auto reach = static_cast<std::ptrdiff_t>(0.5 * width_hz / bin_hz);
  const auto power_at = [&](std::ptrdiff_t bin) {
    return std::norm(
        spectrum[static_cast<std::size_t>(bin < 0 ? bin + std::ssize(spectrum) : bin)]);
  };
  std::vector<std::ptrdiff_t> peaks;
  constexpr double kNotNoise = 12;  // times the power that the dwells have apart
  const double apart_V2 = parts.abs2().sum();
  for (std::ptrdiff_t bin = -reach; bin <= reach; ++bin)
    if (power_at(bin) > kNotNoise * apart_V2 && power_at(bin) >= power_at(bin - 1) &&
        power_at(bin) >= power_at(bin + 1))
      peaks.push_back(bin);
  if (peaks.empty()) return f_hz;
  // Dwells at equal distances in time have many peaks of one height there; only the course within
  // the dwells tells them apart, so each is climbed.
  constexpr std::size_t kPeaks = 24;
  const std::size_t looked_at = std::min(kPeaks, peaks.size());
  std::partial_sort(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(looked_at),
                    peaks.end(),
                    [&](std::ptrdiff_t a, std::ptrdiff_t b) { return power_at(a) > power_at(b); });
  peaks.resize(looked_at);
  double best_hz = f_hz, best_power = joint_power(dwells, f_hz);
  for (const std::ptrdiff_t peak : peaks) {
    double at_hz = f_hz + bin_hz * static_cast<double>(peak), power = joint_power(dwells, at_hz);
    double step_hz = 0.5 * bin_hz;
    while (step_hz > 1e-2 * bin_hz) {
      const double centre_hz = at_hz;
      for (const double trial_hz : {centre_hz - step_hz, centre_hz + step_hz}) {
        const double trial = joint_power(dwells, trial_hz);
        if (trial <= power) continue;
        power = trial;
        at_hz = trial_hz;
      }
      step_hz /= 2;
    }
    if (power <= best_power) continue;
    best_power = power;
    best_hz = at_hz;
  }
  return best_hz;
}

}  // namespace

std::optional<DwellLine> line_through_dwells(const MeasurementSet& set, std::size_t axis) {
  constexpr std::size_t kStrongest = 3;
  const Dwells dwells = dwells_of(set, axis);
  if (dwells.t_s.size() < kFewestDwells || !(dwells.step_s > 0)) return {};
  const auto longest = static_cast<std::size_t>(dwells.off_V.rows());
  const double dwell_s = dwells.step_s * static_cast<double>(longest);
  const double width_hz = 0.5 / dwell_s, nyquist_hz = 0.5 / dwells.step_s;

  // Power at each frequency over that of white noise there, which the removal of what is slow
  // lowers towards the lower end.
  struct Band {
    double f_hz = 0;
    double power = 0;
  };
  std::vector<Band> bands;
  Eigen::FFT<double> transform;
  const Eigen::ArrayXd power_V2 = power_in_bands(dwells.off_V, transform);
  const Eigen::ArrayXd removed = power_in_bands(dwells.removed, transform);
  for (Eigen::Index k = 3; k < power_V2.size(); ++k)
    bands.push_back({width_hz * static_cast<double>(k),
                     power_V2(k) / (1 - removed(k) / static_cast<double>(longest))});
  const std::size_t looked_at = std::min(kStrongest, bands.size());
  std::partial_sort(bands.begin(), bands.begin() + static_cast<std::ptrdiff_t>(looked_at),
                    bands.end(), [](const Band& a, const Band& b) { return a.power > b.power; });

  double best_hz = 0, best_power = 0;
  for (std::size_t k = 0; k < looked_at; ++k) {
    const double f_hz = best_frequency(dwells, bands[k].f_hz, width_hz, transform);
    const double power = joint_power(dwells, f_hz);
    if (power <= best_power) continue;
    best_power = power;
    best_hz = f_hz;
  }
  const double apart_V2 = components(dwells, best_hz).abs2().sum() / share_left(dwells, best_hz);
  const double looks = static_cast<double>(looked_at) * width_hz * dwells.run_s();
  if (!(apart_V2 > 0) || looks * std::exp(-best_power / apart_V2) > kFalseAlarm) return {};
  // What lies beyond half the sampling rate is its own mirror image.
  if (best_hz > nyquist_hz) best_hz = 2 * nyquist_hz - best_hz;
  const std::complex<double> sum = components(dwells, best_hz).sum();
  const double phase =
      std::arg(sum) + 0.25 * effect::kTurn_rad - effect::kTurn_rad * best_hz * dwells.origin_s;
  return DwellLine{best_hz, 2 * std::abs(sum) / (share_left(dwells, best_hz) * dwells.samples),
                   phase - effect::kTurn_rad * std::floor(phase / effect::kTurn_rad)};
}

}  // namespace plumbline
