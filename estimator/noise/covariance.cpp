#include "estimator/noise/covariance.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "estimator/median.h"

namespace plumbline {

namespace {

/// Spans over which flicker noise averages to the level that is meant by U₀.
constexpr double kFlickerReach = 2;

double begin_s(const SampleWindow& w) { return w.first_s - w.step_s; }
double middle_s(const SampleWindow& w) { return begin_s(w) + 0.5 * w.duration_s(); }

/// Second antiderivative of ln|x|.
double log_twice_integrated(double x) {
  return x == 0 ? 0 : 0.5 * x * x * std::log(std::abs(x)) - 0.75 * x * x;
}

/// ln|t − s| averaged over t and s in two windows.
double mean_log_distance(const SampleWindow& a, const SampleWindow& b) {
  const double wa = a.duration_s();
  const double wb = b.duration_s();
  const double apart = std::abs(middle_s(b) - middle_s(a));
  // Far apart the closed form cancels; the series is then exact to 1e-9.
  if (apart > 100 * (wa + wb)) return std::log(apart) - (wa * wa + wb * wb) / (24 * apart * apart);
  const double x = begin_s(b) - begin_s(a);
  return (log_twice_integrated(x + wb) + log_twice_integrated(x - wa) - log_twice_integrated(x) -
          log_twice_integrated(x + wb - wa)) /
         (wa * wb);
}

}  // namespace

Eigen::MatrixXd bounded_walk(const std::vector<SampleWindow>& windows, double decay_per_s) {
  const auto n = static_cast<Eigen::Index>(windows.size());
  const double variance = 0.5 / decay_per_s;
  Eigen::VectorXd averaged(n);  // of exp(−decay·t) over the window
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double x = decay_per_s * windows[static_cast<std::size_t>(i)].duration_s();
    averaged(i) = x > 1e-6 ? -std::expm1(-x) / x : 1 - 0.5 * x;
    covariance(i, i) = x > 1e-3 ? variance * 2 * (1 - averaged(i)) / x : variance * (1 - x / 3);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const SampleWindow& a = windows[static_cast<std::size_t>(i)];
    const double end_s = begin_s(a) + a.duration_s();
    for (Eigen::Index j = i + 1; j < n; ++j) {
      const double apart_s = std::max(begin_s(windows[static_cast<std::size_t>(j)]) - end_s, 0.0);
      covariance(i, j) = variance * averaged(i) * averaged(j) * std::exp(-decay_per_s * apart_s);
      covariance(j, i) = covariance(i, j);
    }
  }
  return covariance;
}

Eigen::MatrixXd smooth_walk(const std::vector<SampleWindow>& windows, double bend_rad_per_s) {
  const auto n = static_cast<Eigen::Index>(windows.size());
  const double variance = 1 / (2 * std::numbers::sqrt2 * std::pow(bend_rad_per_s, 3));
  const double rate_per_s = bend_rad_per_s / std::numbers::sqrt2;
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    covariance(i, i) = variance;
    const double from_s = middle_s(windows[static_cast<std::size_t>(i)]);
    for (Eigen::Index j = i + 1; j < n; ++j) {
      const double x = rate_per_s * (middle_s(windows[static_cast<std::size_t>(j)]) - from_s);
      covariance(i, j) = variance * std::exp(-x) * (std::cos(x) + std::sin(x));
      covariance(j, i) = covariance(i, j);
    }
  }
  return covariance;
}

std::vector<SampleWindow> without_pauses(std::vector<SampleWindow> windows) {
  for (std::size_t k = 1; k < windows.size(); ++k)
    windows[k].first_s = windows[k - 1].first_s + windows[k - 1].duration_s();
  return windows;
}

double share_of_sine(const SampleWindow& window, double f_hz) {
  // Dirichlet's kernel.
  const double half = std::numbers::pi * f_hz * window.step_s;
  const double n = static_cast<double>(window.count);
  return std::abs(std::sin(half)) < 1e-12 ? std::cos(n * half) / std::cos(half)
                                          : std::sin(n * half) / (n * std::sin(half));
}

Eigen::MatrixXd narrow_band(const std::vector<SampleWindow>& windows, const NarrowBand& band) {
  const auto n = static_cast<Eigen::Index>(windows.size());
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const SampleWindow& a = windows[static_cast<std::size_t>(i)];
    const double share = share_of_sine(a, band.f_hz);
    for (Eigen::Index j = i; j < n; ++j) {
      const SampleWindow& b = windows[static_cast<std::size_t>(j)];
      const double apart_s = middle_s(b) - middle_s(a);
      covariance(i, j) = share * share_of_sine(b, band.f_hz) *
                         std::exp(-apart_s * band.decay_per_s) *
                         std::cos(2 * std::numbers::pi * band.f_hz * apart_s);
      covariance(j, i) = covariance(i, j);
    }
  }
  return covariance;
}

std::vector<SampleWindow> pose_windows(const SampleTable& samples, const std::vector<Pose>& poses,
                                       double single_step_s) {
  std::vector<SampleWindow> windows;
  windows.reserve(poses.size());
  std::vector<double> steps;
  double other_step = 0;  // for poses of a single sample
  for (const Pose& pose : poses) {
    assert(pose.count > 0 && pose.first + pose.count <= samples.size());
    steps.clear();
    for (std::size_t i = pose.first + 1; i < pose.first + pose.count; ++i)
      steps.push_back(samples.t_s[i] - samples.t_s[i - 1]);
    double step = 0;
    if (!steps.empty()) {
      step = median(steps);
      other_step = step;
    }
    windows.push_back({samples.t_s[pose.first], step, pose.count});
  }
  for (SampleWindow& window : windows)
    if (window.step_s == 0) window.step_s = other_step > 0 ? other_step : single_step_s;
  return windows;
}

std::array<Eigen::MatrixXd, kTermCount> unit_covariances(const std::vector<SampleWindow>& windows,
                                                         double walk_decay_per_s) {
  const auto n = static_cast<Eigen::Index>(windows.size());
  std::array<Eigen::MatrixXd, kTermCount> unit;
  unit.fill(Eigen::MatrixXd::Zero(n, n));
  if (n == 0) return unit;
  const double origin = begin_s(windows.front());
  const double span = begin_s(windows.back()) + windows.back().duration_s() - origin;
  const double log_reach = std::log(kFlickerReach * span);
  Eigen::VectorXd time(n);
  for (Eigen::Index i = 0; i < n; ++i)
    time(i) = middle_s(windows[static_cast<std::size_t>(i)]) - origin - 0.5 * span;

  for (Eigen::Index i = 0; i < n; ++i) {
    const SampleWindow& a = windows[static_cast<std::size_t>(i)];
    assert(a.count > 0 && a.step_s > 0);
    const double width = a.duration_s();
    // The increments of quantization cancel within a window but for the two ends.
    unit[kTermQ](i, i) = 2 / (width * width);
    unit[kTermN](i, i) = 1 / width;
    unit[kTermB](i, i) = (log_reach - mean_log_distance(a, a)) * std::numbers::inv_pi;
    // A random walk of `count` steps, averaged, after the time up to the window.
    const double count = static_cast<double>(a.count);
    const double before = begin_s(a) - origin;
    unit[kTermK](i, i) = before + a.step_s * (count + 1) * (2 * count + 1) / (6 * count);
    const double mean_walk = before + 0.5 * a.step_s * (count + 1);
    for (Eigen::Index j = i + 1; j < n; ++j) {
      const SampleWindow& b = windows[static_cast<std::size_t>(j)];
      unit[kTermB](i, j) = (log_reach - mean_log_distance(a, b)) * std::numbers::inv_pi;
      unit[kTermK](i, j) = mean_walk;
      unit[kTermB](j, i) = unit[kTermB](i, j);
      unit[kTermK](j, i) = unit[kTermK](i, j);
    }
    if (i + 1 < n) {
      const SampleWindow& b = windows[static_cast<std::size_t>(i + 1)];
      const bool touching = begin_s(b) - (begin_s(a) + width) < 0.5 * a.step_s;
      if (touching) {
        unit[kTermQ](i, i + 1) = -1 / (width * b.duration_s());
        unit[kTermQ](i + 1, i) = unit[kTermQ](i, i + 1);
      }
    }
  }
  unit[kTermR] = time * time.transpose();
  if (walk_decay_per_s > 0) unit[kTermK] = bounded_walk(windows, walk_decay_per_s);
  return unit;
}

Eigen::MatrixXd mean_covariance(const NoiseModel& model, const std::vector<SampleWindow>& windows) {
  const std::array<Eigen::MatrixXd, kTermCount> unit =
      unit_covariances(windows, model.walk_decay_per_s);
  const NoisePowers power = noise_powers(model);
  const auto n = static_cast<Eigen::Index>(windows.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t term = 0; term < kTermCount; ++term)
    covariance += power(static_cast<Eigen::Index>(term)) * unit[term];
  return covariance;
}

double rounding_variance(double step, double sigma) {
  assert(step > 0 && sigma >= 0);
  const double ratio = 2 * std::numbers::pi * sigma / step;
  if (ratio < 1e-3) return step * step / 12;
  double sum = 0;
  for (int k = 1; k <= 10000; ++k) {
    const double term = std::exp(-ratio * ratio * k * k) / (k * k);
    sum += term;
    if (term < 1e-12) break;
  }
  return step * step / (2 * std::numbers::pi * std::numbers::pi) * sum;
}

namespace {

constexpr int kHarmonics = 50;  // of the sawtooth; the sharpest edges are a fiftieth of a step wide

}  // namespace

RoundingBias rounding_bias(double value, double origin, double step, double sigma) {
  assert(step > 0 && sigma >= 0);
  const double turn = 2 * std::numbers::pi * std::remainder((value - origin) / step, 1.0);
  const double fade = 2 * std::numbers::pi * std::numbers::pi * sigma * sigma / (step * step);
  RoundingBias result;
  for (int k = 1; k <= kHarmonics; ++k) {
    const double size = (k % 2 == 0 ? 1 : -1) * std::exp(-fade * k * k);
    if (std::abs(size) < 1e-9) break;
    result.bias += step / (std::numbers::pi * k) * size * std::sin(turn * k);
    result.slope += 2 * size * std::cos(turn * k);
  }
  return result;
}

double rounding_variance_left(double step, double sigma, double slow) {
  assert(step > 0 && sigma >= 0 && slow >= 0);
  const double turn = 2 * std::numbers::pi / step;
  double sum = 0;
  for (int k = 1; k <= kHarmonics; ++k) {
    const double size = std::exp(-turn * turn * sigma * sigma * k * k);
    if (size < 1e-12) break;
    const double lost = turn * turn * slow * slow * k * k;
    sum +=
        size * (-2 / (turn * turn * k * k) * std::expm1(-lost) - 2 * slow * slow * std::exp(-lost));
  }
  return std::max(sum, 0.0);
}

}  // namespace plumbline
