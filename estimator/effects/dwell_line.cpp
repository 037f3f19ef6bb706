#include "estimator/effects/dwell_line.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <unsupported/Eigen/FFT>
#include <utility>

#include "estimator/effects/effect.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

constexpr std::size_t kFewestSamples = 8;
constexpr Eigen::Index kFewestDwells = 10;
// The search that follows counts the line as one candidate, whose frequency was not looked for, and
// real lines are beyond doubt in thousands of readings.
constexpr double kFalseAlarm = 1e-8;

/// All dwells of one axis, side by side: their course, or what their means leave.
struct Dwells {
  Eigen::ArrayXd t_s;         ///< first sample of each, from the first of all
  double origin_s = 0;        ///< of those times, on the clock of the run
  double step_s = 0;          ///< between samples
  double samples = 0;         ///< of all
  Eigen::MatrixXd off_V;      ///< samples × dwells; a shorter dwell ends in zeros
  Eigen::MatrixXd slow;       ///< of the longest: its mean and what changes slowly, orthonormal
  bool slow_is_left = false;  ///< and nothing else; otherwise all but that
  double run_s() const { return t_s(t_s.size() - 1); }
  double dwell_s() const { return step_s * static_cast<double>(off_V.rows()); }
  bool say_enough() const { return t_s.size() >= kFewestDwells && step_s > 0; }
  /// Whether some arrivals are no whole number of samples apart.
  bool tell_aliases() const {
    constexpr double kApart = 1e-4;  // samples
    const Eigen::ArrayXd samples_apart = t_s / step_s;
    return ((samples_apart - samples_apart.round()).abs() > kApart).any();
  }
};

/// Their times, and zeros.
Dwells empty_dwells(const MeasurementSet& set) {
  std::vector<double> t_s;
  std::size_t longest = 0;
  double steps = 0, spans_s = 0;
  for (const Pose& pose : set.poses) {
    if (pose.count < kFewestSamples) continue;
    const double first_s = set.samples.t_s[pose.first];
    longest = std::max(longest, pose.count);
    t_s.push_back(first_s);
    spans_s += set.samples.t_s[pose.first + pose.count - 1] - first_s;
    steps += static_cast<double>(pose.count - 1);
  }
  Dwells dwells;
  if (t_s.empty()) return dwells;
  dwells.origin_s = t_s.front();
  dwells.t_s = Eigen::Map<const Eigen::ArrayXd>(t_s.data(), std::ssize(t_s)) - dwells.origin_s;
  dwells.step_s = spans_s / steps;
  dwells.samples = steps + static_cast<double>(t_s.size());
  dwells.off_V.setZero(static_cast<Eigen::Index>(longest), std::ssize(t_s));
  return dwells;
}

Eigen::VectorXd constant(Eigen::Index samples) {
  return Eigen::VectorXd::Constant(samples, 1 / std::sqrt(static_cast<double>(samples)));
}

/// The course of the dwells without `slow`.
Dwells courses_of(const MeasurementSet& set, std::size_t axis) {
  Dwells dwells = empty_dwells(set);
  std::map<std::size_t, Eigen::MatrixXd> slow;
  Eigen::Index k = 0;
  for (const Pose& pose : set.poses) {
    if (pose.count < kFewestSamples) continue;
    const auto n = static_cast<Eigen::Index>(pose.count);
    const Eigen::Map<const Eigen::VectorXd> u_V(set.samples.u_V[axis].data() + pose.first, n);
    if (!slow.contains(pose.count)) slow.emplace(pose.count, step_contrasts(pose.count));
    const Eigen::MatrixXd& contrasts = slow.at(pose.count);
    Eigen::VectorXd off_V = u_V.array() - u_V.mean();
    off_V -= contrasts * (contrasts.transpose() * off_V);
    dwells.off_V.col(k++).head(n) = off_V;
  }
  const Eigen::MatrixXd steps_of_longest =
      step_contrasts(static_cast<std::size_t>(dwells.off_V.rows()));
  dwells.slow.resize(steps_of_longest.rows(), steps_of_longest.cols() + 1);
  dwells.slow << steps_of_longest, constant(dwells.off_V.rows());
  return dwells;
}

/// Every dwell at one value, which its mean leaves.
Dwells constants_of(const MeasurementSet& set, const Eigen::VectorXd& left_V) {
  Dwells dwells = empty_dwells(set);
  dwells.slow_is_left = true;
  Eigen::Index k = 0;
  for (std::size_t pose = 0; pose < set.poses.size(); ++pose)
    if (set.poses[pose].count >= kFewestSamples)
      dwells.off_V.col(k++).head(static_cast<Eigen::Index>(set.poses[pose].count)).array() =
          left_V(static_cast<Eigen::Index>(pose));
  dwells.slow = constant(dwells.off_V.rows());
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

/// Share of a sine of this frequency that is left in them.
double share_left(const Dwells& dwells, double f_hz) {
  const double slow = along_columns(dwells.slow, dwells.step_s, f_hz).abs2().sum() /
                      static_cast<double>(dwells.off_V.rows());
  return dwells.slow_is_left ? slow : 1 - slow;
}

/// By what a power at this frequency is to be multiplied to be as large as if nothing had been
/// removed. In means at even distances all aliases are alike but for that: a little less prefers
/// the one that needs the smallest amplitude.
double restored(const Dwells& dwells, double f_hz) {
  constexpr double kLess = 0.01;
  return std::pow(share_left(dwells, f_hz), (dwells.slow_is_left ? kLess : 0) - 1);
}

/// Power of the dwells together at a frequency.
double joint_power(const Dwells& dwells, double f_hz) {
  return std::norm(components(dwells, f_hz).sum()) * restored(dwells, f_hz);
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

/// What the dwells say of a line at one frequency.
struct Peak {
  double f_hz = 0;
  double joint_V2 = 0;  ///< power of the dwells together
  double apart_V2 = 0;  ///< sum of the powers of each
};
Peak peak_at(const Dwells& dwells, double f_hz) {
  return {f_hz, joint_power(dwells, f_hz),
          components(dwells, f_hz).abs2().sum() * restored(dwells, f_hz)};
}

/// Whether the phases of the dwells prefer one frequency to another beyond doubt.
bool is_clearly_likelier(const Peak& peak, const Peak& other, const Dwells& dwells) {
  constexpr double kClearly = 10;  // of ln L
  // A mean, being real, shows one side of a sine only: half of its power.
  const double sides = dwells.slow_is_left ? 2 : 1;
  const double noise_V2 =
      peak.apart_V2 - sides * peak.joint_V2 / static_cast<double>(dwells.t_s.size());
  return peak.joint_V2 - other.joint_V2 > kClearly * noise_V2;
}

/// A line is looked for up to this many times the sampling rate.
constexpr int kRates = 6;

/// The strongest line of which the alias lies within ±width/2 of `f_hz`. Within a dwell all of them
/// look the same; arrivals that are no whole number of samples apart tell them from each other.
/// Where none do, the alias stands for them all.
Peak strongest_alias(const Dwells& dwells, double f_hz, double width_hz,
                     Eigen::FFT<double>& transform) {
  const double rate_hz = 1 / dwells.step_s;
  const auto strongest_near = [&](double near_hz) {
    return peak_at(dwells, best_frequency(dwells, near_hz, width_hz, transform));
  };
  Peak best = strongest_near(f_hz);
  if (best.f_hz > 0.5 * rate_hz) {
    const Peak mirrored = peak_at(dwells, rate_hz - best.f_hz);
    if (!is_clearly_likelier(best, mirrored, dwells)) best = mirrored;
  }
  for (int rates = 1; dwells.tell_aliases() && rates <= kRates; ++rates)
    for (const double side : {-1, 1}) {
      const Peak other = strongest_near(rates * rate_hz + side * f_hz);
      if (is_clearly_likelier(other, best, dwells)) best = other;
    }
  return best;
}

/// Whether a line is as strong in the second half of the dwells as in the first: what dies away
/// there was begun by the move before, and has one phase in all dwells where they begin at even
/// times.
bool is_steady(const Dwells& dwells, const Peak& peak) {
  constexpr double kClearly = 3.5;  // standard deviations
  constexpr double kMuch = 1.4;     // as a ratio
  const Eigen::Index half = dwells.off_V.rows() / 2;
  const Eigen::ArrayXcd begins = turning(peak.f_hz, dwells.t_s);
  const auto strength = [&](const Eigen::MatrixXd& part) {
    const Eigen::ArrayXcd parts = along_columns(part, dwells.step_s, peak.f_hz) * begins;
    const double joint = std::abs(parts.sum());
    const double spread = parts.abs2().sum() - joint * joint / static_cast<double>(parts.size());
    return std::pair{joint, std::sqrt(std::max(0.0, spread))};
  };
  const auto [first, first_sd] = strength(dwells.off_V.topRows(half));
  const auto [second, second_sd] = strength(dwells.off_V.middleRows(half, half));
  return first < kMuch * second || first - second < kClearly * std::hypot(first_sd, second_sd);
}

/// Whether a line of few periods a dwell has the same phase on every arrival, or the opposite one:
/// a course of the dwells that is no sine, of which the slow contrasts leave what looks like one.
bool begins_on_arrival(const Dwells& dwells, const Peak& peak) {
  constexpr double kFewPeriods = 5;
  constexpr double kAlike = 0.99;
  if (dwells.slow_is_left || peak.f_hz * dwells.dwell_s() > kFewPeriods) return false;
  const Eigen::ArrayXcd on_arrival = along_columns(dwells.off_V, dwells.step_s, peak.f_hz);
  return std::abs(on_arrival.square().sum()) >
         kAlike * std::abs(components(dwells, peak.f_hz).square().sum());
}

/// Unless noise shows one as strong somewhere among so many frequencies.
std::optional<DwellLine> line_of(const Dwells& dwells, const Peak& peak, double frequencies) {
  if (!(peak.apart_V2 > 0) || frequencies * std::exp(-peak.joint_V2 / peak.apart_V2) > kFalseAlarm)
    return {};
  const std::complex<double> sum = components(dwells, peak.f_hz).sum();
  const double phase =
      std::arg(sum) + 0.25 * effect::kTurn_rad - effect::kTurn_rad * peak.f_hz * dwells.origin_s;
  return DwellLine{
      peak.f_hz, 2 * std::abs(sum) / (share_left(dwells, peak.f_hz) * dwells.samples),
      phase - effect::kTurn_rad * std::floor(phase / effect::kTurn_rad),
      dwells.slow_is_left || (is_steady(dwells, peak) && !begins_on_arrival(dwells, peak))};
}

/// The strongest line in the courses of dwells.
std::optional<DwellLine> line_in_courses(const Dwells& dwells) {
  constexpr std::size_t kStrongest = 3;
  if (!dwells.say_enough()) return {};
  const double width_hz = 0.5 / dwells.dwell_s();

  // Power at each frequency over that of white noise there, which the removal of what is slow
  // lowers towards the lower end.
  struct Band {
    double f_hz = 0;
    double power = 0;
  };
  std::vector<Band> bands;
  Eigen::FFT<double> transform;
  const Eigen::ArrayXd power_V2 = power_in_bands(dwells.off_V, transform);
  const Eigen::ArrayXd slow = power_in_bands(dwells.slow, transform);
  for (Eigen::Index k = 3; k < power_V2.size(); ++k)
    bands.push_back({width_hz * static_cast<double>(k),
                     power_V2(k) / (1 - slow(k) / static_cast<double>(dwells.off_V.rows()))});
  const std::size_t looked_at = std::min(kStrongest, bands.size());
  std::partial_sort(bands.begin(), bands.begin() + static_cast<std::ptrdiff_t>(looked_at),
                    bands.end(), [](const Band& a, const Band& b) { return a.power > b.power; });

  Peak best;
  for (std::size_t k = 0; k < looked_at; ++k) {
    const Peak peak = strongest_alias(dwells, bands[k].f_hz, width_hz, transform);
    if (peak.joint_V2 > best.joint_V2) best = peak;
  }
  const double aliases = 1 + 2 * kRates;
  return line_of(dwells, best,
                 aliases * static_cast<double>(looked_at) * width_hz * dwells.run_s());
}

}  // namespace

std::optional<DwellLine> line_through_dwells(const MeasurementSet& set, std::size_t axis) {
  return line_in_courses(courses_of(set, axis));
}

std::vector<std::optional<DwellLine>> lines_of_all(
    const MeasurementSet& set, const std::vector<PerAxis<Eigen::VectorXd>>& seen) {
  std::vector<std::optional<DwellLine>> lines(seen.size());
  PerAxis<Dwells> courses;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    courses[axis] = courses_of(set, axis);
    if (!courses[axis].say_enough()) return lines;
  }
  std::vector<Eigen::Index> poses;  // of the dwells
  for (std::size_t pose = 0; pose < set.poses.size(); ++pose)
    if (set.poses[pose].count >= kFewestSamples) poses.push_back(static_cast<Eigen::Index>(pose));
  parallel_for(seen.size(), [&](std::size_t k) {
    Dwells sum = courses[0];
    sum.off_V.setZero();
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      sum.off_V += courses[axis].off_V * seen[k][axis](poses).asDiagonal();
    lines[k] = line_in_courses(sum);
  });
  return lines;
}

std::optional<DwellLine> line_between_dwells(const MeasurementSet& set,
                                             const Eigen::VectorXd& left_V) {
  constexpr double kPeriods = 1.25;  // in a dwell, beyond which little is left in the mean
  const Dwells dwells = constants_of(set, left_V);
  if (!dwells.say_enough()) return {};
  const double width_hz = kPeriods / dwells.dwell_s();
  Eigen::FFT<double> transform;
  const Peak best = strongest_alias(dwells, 0.5 * width_hz, width_hz, transform);
  // What is slower than two visits is a course of the whole run, and so is what may as well be
  // slower than some more: between visits at even distances such a course has faster aliases.
  const double visits_hz = static_cast<double>(dwells.t_s.size()) / dwells.run_s();
  if (best.f_hz < 0.5 * visits_hz) return {};
  const double slow_hz = 0.125 * visits_hz;
  const Peak slow = peak_at(dwells, best_frequency(dwells, 0.5 * slow_hz, slow_hz, transform));
  if (!is_clearly_likelier(best, slow, dwells)) return {};
  const double aliases = 1 + 2 * kRates;
  return line_of(dwells, best, aliases * width_hz * dwells.run_s());
}

}  // namespace plumbline
