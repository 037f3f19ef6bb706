#include "estimator/noise/spectrum_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace plumbline {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Slope fit_slope(const SpectrumSums& sums, const VectorXd& variance) {
  double cross = 0;
  double ramp = 0;
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    cross += sums.bins[i].cross / variance(static_cast<Index>(i));
    ramp += sums.bins[i].ramp / variance(static_cast<Index>(i));
  }
  if (!(ramp > 0)) return {};  // a spectrum without low frequencies knows no ramp
  return {cross / ramp, 1 / ramp};
}

double deviance(const SpectrumSums& sums, const VectorXd& variance, const Slope& slope) {
  double sum = slope.variance > 0 ? -std::log(slope.variance) : 0;
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    const SpectrumSum& bin = sums.bins[i];
    const double v = variance(static_cast<Index>(i));
    sum += bin.count * std::log(v) + square_without_ramp(bin, slope.value) / v;
  }
  return sum;
}

/// argmin ½θ'Aθ − b'θ over θ ≥ 0 for A symmetric and positive definite on the free terms; terms
/// with a bit in `held` keep their value in `theta` (Lawson & Hanson's active sets).
VectorXd nonnegative_minimum(const MatrixXd& a, const VectorXd& b, const VectorXd& theta,
                             unsigned held) {
  const Index p = b.size();
  VectorXd x = theta;
  std::vector<bool> free(static_cast<std::size_t>(p), false);
  const auto is_held = [&](Index i) { return (held >> i & 1U) != 0; };
  for (Index i = 0; i < p; ++i) {
    free[static_cast<std::size_t>(i)] = !is_held(i) && theta(i) > 0;
    if (!is_held(i) && !(theta(i) > 0)) x(i) = 0;
  }
  for (int round = 0; round < 8 * static_cast<int>(p); ++round) {
    std::vector<Index> places;
    for (Index i = 0; i < p; ++i)
      if (free[static_cast<std::size_t>(i)]) places.push_back(i);
    if (!places.empty()) {
      VectorXd fixed = x;
      for (const Index i : places) fixed(i) = 0;
      const VectorXd right = (b - a * fixed)(places);
      const MatrixXd left = a(places, places);
      const VectorXd scale = left.diagonal().cwiseSqrt().cwiseInverse();
      const MatrixXd scaled = scale.asDiagonal() * left * scale.asDiagonal();
      const VectorXd target =
          scale.asDiagonal() * scaled.ldlt().solve(VectorXd(scale.asDiagonal() * right));
      // As far towards the target as all stay nonnegative.
      double step = 1;
      Index blocking = -1;
      for (std::size_t j = 0; j < places.size(); ++j) {
        const double now = x(places[j]);
        const double next = target(static_cast<Index>(j));
        if (next > 0) continue;
        const double part = now > next ? now / (now - next) : 0;
        if (part < step || blocking < 0) {
          step = std::min(step, part);
          blocking = places[j];
        }
      }
      for (std::size_t j = 0; j < places.size(); ++j)
        x(places[j]) += step * (target(static_cast<Index>(j)) - x(places[j]));
      if (blocking >= 0) {
        x(blocking) = 0;
        free[static_cast<std::size_t>(blocking)] = false;
        continue;
      }
    }
    // Free the term at zero that would gain most, in units of its own curvature.
    const VectorXd gradient = b - a * x;
    Index best = -1;
    double gain = 1e-12;
    for (Index i = 0; i < p; ++i) {
      if (is_held(i) || free[static_cast<std::size_t>(i)] || !(a(i, i) > 0)) continue;
      const double here = gradient(i) / std::sqrt(a(i, i));
      if (here > gain) {
        gain = here;
        best = i;
      }
    }
    if (best < 0) break;
    free[static_cast<std::size_t>(best)] = true;
  }
  return x;
}

}  // namespace

double square_without_ramp(const SpectrumSum& bin, double slope) {
  return std::max(0.0, bin.square - slope * (2 * bin.cross - slope * bin.ramp));
}

MatrixXd shape_densities(const SpectrumSums& sums, const SpectrumShape& shape) {
  MatrixXd density(shape.terms(), static_cast<Index>(sums.bins.size()));
  const std::size_t n = sums.length;
  const double rate_hz = sums.rate_hz;
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    const SpectrumSum& bin = sums.bins[i];
    auto column = density.col(static_cast<Index>(i));
    column(0) = bin_mean(bin, [&](double k) { return quantization_variance(k, n, rate_hz); });
    column(1) = rate_hz;
    column(2) = bin_mean(bin, [&](double k) {
      return flicker_variance(k, n, rate_hz, 0, std::numeric_limits<double>::infinity());
    });
    column(3) = bin_mean(bin, [&](double k) { return walk_variance(k, n, rate_hz, 0); });
  }
  fill_shape(sums, shape, density);
  return density;
}

void fill_shape(const SpectrumSums& sums, const SpectrumShape& shape, MatrixXd& density) {
  const std::size_t n = sums.length;
  const double rate_hz = sums.rate_hz;
  const bool limited = shape.flicker_low_hz > 0 || std::isfinite(shape.flicker_high_hz);
  if (!limited && shape.markov_tau_s.empty()) return;
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    const SpectrumSum& bin = sums.bins[i];
    auto column = density.col(static_cast<Index>(i));
    if (limited) {
      column(2) = bin_mean(bin, [&](double k) {
        return flicker_variance(k, n, rate_hz, shape.flicker_low_hz, shape.flicker_high_hz);
      });
    }
    for (std::size_t j = 0; j < shape.markov_tau_s.size(); ++j)
      column(static_cast<Index>(4 + j)) = bin_mean(
          bin, [&](double k) { return markov_variance(k, n, rate_hz, shape.markov_tau_s[j]); });
  }
}

MatrixXd fisher_information(const SpectrumSums& sums, const MatrixXd& derivative,
                            const VectorXd& variance) {
  const Slope slope = fit_slope(sums, variance);
  const auto count = static_cast<Index>(sums.bins.size());
  VectorXd weight(count);
  VectorXd ramp_weight(count);
  for (Index i = 0; i < count; ++i) {
    const SpectrumSum& bin = sums.bins[static_cast<std::size_t>(i)];
    weight(i) = bin.count / (variance(i) * variance(i));
    ramp_weight(i) = slope.variance * bin.ramp / (variance(i) * variance(i));
  }
  const VectorXd single = derivative * ramp_weight;
  const VectorXd both = weight - 2 * ramp_weight.cwiseQuotient(variance);
  return 0.5 *
         (derivative * both.asDiagonal() * derivative.transpose() + single * single.transpose());
}

SpectrumFit fit_powers(const SpectrumSums& sums, const MatrixXd& density, const VectorXd& start,
                       unsigned held) {
  assert(start.sum() > 0);
  constexpr int kIterations = 200;
  constexpr int kHalvings = 14;
  constexpr double kGained = 1e-5;  // far below what any decision rests on
  const Index p = density.rows();
  const auto count = static_cast<Index>(sums.bins.size());
  SpectrumFit now;
  now.power = start;
  VectorXd variance = density.transpose() * now.power;
  Slope slope = fit_slope(sums, variance);
  now.deviance = deviance(sums, variance, slope);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    // The weights of the scoring step; the slope's own variance gives back the degree of freedom
    // it took.
    const MatrixXd normal = 2 * fisher_information(sums, density, variance);
    VectorXd excess(count);
    for (Index i = 0; i < count; ++i) {
      const SpectrumSum& bin = sums.bins[static_cast<std::size_t>(i)];
      const double v = variance(i);
      const double square = square_without_ramp(bin, slope.value) + slope.variance * bin.ramp;
      excess(i) = (square - bin.count * v) / (v * v);
    }
    const VectorXd right = normal * now.power + density * excess;
    const VectorXd target = nonnegative_minimum(normal, right, now.power, held);
    SpectrumFit next;
    VectorXd next_variance(count);
    Slope next_slope;
    for (int halving = 0; halving < kHalvings; ++halving) {
      next.power = now.power + std::ldexp(1.0, -halving) * (target - now.power);
      for (Index i = 0; i < p; ++i) next.power(i) = std::max(0.0, next.power(i));
      next_variance = density.transpose() * next.power;
      if (!(next_variance.minCoeff() > 0)) continue;
      next_slope = fit_slope(sums, next_variance);
      next.deviance = deviance(sums, next_variance, next_slope);
      if (next.deviance <= now.deviance) break;
    }
    if (!(next.deviance <= now.deviance)) {
      now.converged = true;  // no descent left but rounding
      break;
    }
    const double gained = now.deviance - next.deviance;
    now.power = next.power;
    now.deviance = next.deviance;
    variance = next_variance;
    slope = next_slope;
    if (gained < kGained) {
      now.converged = true;
      break;
    }
  }
  now.slope = slope.value;
  now.slope_variance = slope.variance;
  return now;
}

VectorXd starting_powers(const SpectrumSums& sums, const MatrixXd& density, unsigned held) {
  VectorXd power = VectorXd::Zero(density.rows());
  constexpr std::size_t kGroup = 8;
  for (Index term = 0; term < density.rows(); ++term) {
    if ((held >> term & 1U) != 0) continue;
    double smallest = std::numeric_limits<double>::infinity();
    for (std::size_t begin = 0; begin + kGroup <= sums.bins.size(); begin += kGroup) {
      double square = 0;
      double unit = 0;
      for (std::size_t i = begin; i < begin + kGroup; ++i) {
        square += sums.bins[i].square;
        unit += sums.bins[i].count * density(term, static_cast<Index>(i));
      }
      smallest = std::min(smallest, square / unit);
    }
    power(term) = 0.5 * smallest;
  }
  return power;
}

}  // namespace plumbline
