#include "estimator/noise/term_fit.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "estimator/noise/nonnegative.h"

namespace plumbline {

namespace {

constexpr int kStochastic = 4;  // Q, N, B, K; the ramp is a mean
using Vector4 = Eigen::Vector4d;
using Matrix4 = Eigen::Matrix4d;
using Bin = SpectrumBin;

std::vector<Bin> make_bins(const SpectrumSums& sums, double decay_per_s) {
  const std::size_t n = sums.length;
  const double rate_hz = sums.rate_hz;
  std::vector<Bin> bins;
  bins.reserve(sums.bins.size());
  for (const SpectrumSum& sum : sums.bins) {
    const double middle = static_cast<double>(sum.first) + 0.5 * static_cast<double>(sum.width - 1);
    Bin bin{.frequency_hz = sums.frequency_hz(middle),
            .count = sum.count,
            .square = sum.square,
            .cross = sum.cross,
            .ramp = sum.ramp};
    bin.density = {
        bin_mean(sum, [&](double k) { return quantization_variance(k, n, rate_hz); }), rate_hz,
        bin_mean(sum,
                 [&](double k) {
                   return flicker_variance(k, n, rate_hz, 0,
                                           std::numeric_limits<double>::infinity());
                 }),
        bin_mean(sum, [&](double k) { return walk_variance(k, n, rate_hz, decay_per_s); })};
    bins.push_back(bin);
  }
  return bins;
}

Slope fit_slope(const std::vector<Bin>& bins, const Vector4& power) {
  double cross = 0;
  double ramp = 0;
  for (const Bin& bin : bins) {
    const double variance = bin.density.dot(power);
    cross += bin.cross / variance;
    ramp += bin.ramp / variance;
  }
  if (!(ramp > 0)) return {};  // a spectrum without low frequencies knows no ramp
  return {cross / ramp, 1 / ramp};
}

double bin_square(const Bin& bin, const Slope& slope) {
  return std::max(0.0, bin.square - slope.value * (2 * bin.cross - slope.value * bin.ramp));
}

/// −2 ln of the restricted likelihood.
double deviance(const std::vector<Bin>& bins, const Vector4& power) {
  const Slope slope = fit_slope(bins, power);
  double sum = slope.variance > 0 ? -std::log(slope.variance) : 0;
  for (const Bin& bin : bins) {
    const double variance = bin.density.dot(power);
    sum += bin.count * std::log(variance) + bin_square(bin, slope) / variance;
  }
  return sum;
}

struct Maximum {
  Vector4 power = Vector4::Zero();
  double deviance = std::numeric_limits<double>::infinity();
  bool converged = false;
};

/// Fisher scoring with the constraint of nonnegative powers, for the terms in the bit mask
/// `allowed`; `fixed` is added to them.
Maximum maximise(const std::vector<Bin>& bins, unsigned allowed, const Vector4& start,
                 const Vector4& fixed) {
  constexpr int kIterations = 200;
  Maximum now;
  now.power = start;
  now.deviance = deviance(bins, start + fixed);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Vector4 total = now.power + fixed;
    const Likelihood here = spectrum_likelihood(bins, total);
    const Vector4 target =
        nonnegative_solution(here.normal, here.right - here.normal * fixed, allowed);
    constexpr int kHalvings = 14;
    Maximum next;
    for (int halving = 0; halving < kHalvings; ++halving) {
      next.power = now.power + std::ldexp(1.0, -halving) * (target - now.power);
      const Vector4 candidate = next.power + fixed;
      if (!((candidate.array() * bins.back().density.array()).sum() > 0)) continue;
      next.deviance = deviance(bins, candidate);
      if (next.deviance <= now.deviance) break;
    }
    if (!(next.deviance <= now.deviance)) {
      now.converged = true;  // no descent left but rounding
      break;
    }
    const double gained = now.deviance - next.deviance;
    now.power = next.power;
    now.deviance = next.deviance;
    if (gained < 1e-7) {
      now.converged = true;
      break;
    }
  }
  return now;
}

/// Starting powers: the whole density explained by each term alone at the place where it rules.
Vector4 starting_powers(const std::vector<Bin>& bins, unsigned allowed) {
  Vector4 power = Vector4::Zero();
  for (int i = 0; i < kStochastic; ++i) {
    if ((allowed >> i & 1U) == 0) continue;
    double smallest = std::numeric_limits<double>::infinity();
    for (std::size_t begin = 0; begin + 8 <= bins.size(); begin += 8) {
      double square = 0;
      double density = 0;
      for (std::size_t j = begin; j < begin + 8; ++j) {
        square += bins[j].square;
        density += bins[j].count * bins[j].density(i);
      }
      smallest = std::min(smallest, square / density);
    }
    power(i) = 0.5 * smallest;
  }
  return power;
}

/// The record by one kind of walk.
struct Description {
  double decay_per_s = 0;
  std::vector<Bin> bins;
  Maximum best;
};

/// The unbounded walk first, then walks that forget faster and faster.
std::vector<Description> describe(const SpectrumSums& sums) {
  constexpr unsigned kAll = (1U << kStochastic) - 1;
  const double duration_s = sums.duration_s();
  std::vector<Description> descriptions(1);
  // Correlation times by octaves, from a quarter of the record down to ten samples.
  const int octaves =
      static_cast<int>(std::floor(std::log2(0.025 * static_cast<double>(sums.length))));
  for (int octave = 0; octave <= octaves; ++octave)
    descriptions.emplace_back().decay_per_s = std::ldexp(4 / duration_s, octave);
  for (Description& description : descriptions) {
    description.bins = make_bins(sums, description.decay_per_s);
    description.best =
        maximise(description.bins, kAll, starting_powers(description.bins, kAll), Vector4::Zero());
  }
  return descriptions;
}

/// The description that the record alone supports: the walk, unless a bounded one is clearly
/// better.
std::size_t best_description(const std::vector<Description>& descriptions) {
  // A correlation time is one more parameter, and the best of several: χ²₁ at 0.2 %.
  constexpr double kDecayGain = 9.5;
  std::size_t best = 0;
  double threshold = descriptions[0].best.deviance - kDecayGain;
  for (std::size_t i = 1; i < descriptions.size(); ++i) {
    if (descriptions[i].best.deviance >= threshold) continue;
    threshold = descriptions[i].best.deviance;
    best = i;
  }
  return best;
}

/// Power of term i at which the profile deviance has risen by 2.71 (one-sided 95 %).
double upper_power(const std::vector<Bin>& bins, int term, const Maximum& best, double scale) {
  const double limit = best.deviance + 2.7055;
  const auto others = static_cast<unsigned>(0xF & ~(1U << term));
  const auto profile = [&](double power) {
    Vector4 fixed = Vector4::Zero();
    fixed(term) = power;
    Vector4 start = best.power;
    start(term) = 0;
    return maximise(bins, others, start, fixed).deviance;
  };
  double low = best.power(term);
  double high = low + std::max(scale, 1e-3 * low);
  int doublings = 0;
  while (profile(high) < limit && doublings++ < 40) {
    low = high;
    high = best.power(term) + 2 * (high - best.power(term));
  }
  for (int i = 0; i < 20; ++i) {
    const double middle = 0.5 * (low + high);
    (profile(middle) < limit ? low : high) = middle;
  }
  return high;
}

void judge_fit(const std::vector<Bin>& bins, const Vector4& power, const Slope& slope,
               TermFit& fit) {
  // Bins of at least 8 coefficients, so that each is nearly normal after the cube root.
  double count = 0;
  double ratio = 0;
  int used = 0;
  for (const Bin& bin : bins) {
    count += bin.count;
    ratio += bin_square(bin, slope) / bin.density.dot(power);
    if (count < 8) continue;
    const double s = 2 / (9 * count);
    const double z = (std::cbrt(ratio / count) - (1 - s)) / std::sqrt(s);
    fit.chi2 += z * z;
    ++used;
    count = 0;
    ratio = 0;
  }
  int parameters = 1;
  for (int i = 0; i < kStochastic; ++i) parameters += power(i) > 0 ? 1 : 0;
  fit.dof = std::max(1, used - parameters);
}

}  // namespace

Likelihood spectrum_likelihood(const std::vector<SpectrumBin>& spectrum,
                               const Eigen::Vector4d& power) {
  Likelihood result;
  result.deviance = deviance(spectrum, power);
  Matrix4 plain = Matrix4::Zero();
  Matrix4 mixed = Matrix4::Zero();
  Vector4 single = Vector4::Zero();
  const Slope slope = fit_slope(spectrum, power);
  for (const SpectrumBin& bin : spectrum) {
    const double variance = bin.density.dot(power);
    const double weight = 1 / (variance * variance);
    const Matrix4 outer = bin.density * bin.density.transpose();
    plain += bin.count * weight * outer;
    mixed += bin.ramp * weight / variance * outer;
    single += bin.ramp * weight * bin.density;
    // The slope's own variance gives back the degree of freedom it took.
    const double square = bin_square(bin, slope) + slope.variance * bin.ramp;
    result.right += weight * (square - bin.count * variance) * bin.density;
  }
  result.normal = plain - 2 * slope.variance * mixed +
                  slope.variance * slope.variance * single * single.transpose();
  result.right += result.normal * power;
  return result;
}

TermFit fit_terms(const SpectrumSums& sums) {
  assert(sums.bins.size() >= 8);
  constexpr unsigned kAll = (1U << kStochastic) - 1;
  const std::vector<Description> descriptions = describe(sums);
  const Description& chosen = descriptions[best_description(descriptions)];
  const std::vector<Bin>& bins = chosen.bins;
  const Maximum& best = chosen.best;

  TermFit fit;
  fit.walk_decay_per_s = chosen.decay_per_s;
  for (const Description& description : descriptions) {
    SpectrumDescription& row = fit.descriptions.emplace_back();
    row.walk_decay_per_s = description.decay_per_s;
    row.power.head<kStochastic>() = description.best.power;
    row.deviance = description.best.deviance;
    row.bins = description.bins;
  }
  fit.converged = best.converged;
  fit.spectrum = bins;
  fit.power.head<kStochastic>() = best.power;
  const Slope slope = fit_slope(bins, best.power);
  fit.power(kTermR) = slope.value * slope.value;
  fit.ramp_u = std::sqrt(slope.variance);
  fit.gain(kTermR) = slope.value * slope.value / slope.variance;
  const double ramp_limit = std::abs(slope.value) + 1.645 * fit.ramp_u;
  fit.upper_power(kTermR) = ramp_limit * ramp_limit;
  const Matrix4 information = 0.5 * spectrum_likelihood(bins, best.power).normal;
  fit.information.topLeftCorner<kStochastic, kStochastic>() = information;
  for (int i = 0; i < kStochastic; ++i) {
    Vector4 start = best.power;
    start(i) = 0;
    const auto others = kAll & ~(1U << i);
    if (!(start.maxCoeff() > 0)) start = starting_powers(bins, others);
    if (best.power(i) > 0)
      fit.gain(i) =
          std::max(0.0, maximise(bins, others, start, Vector4::Zero()).deviance - best.deviance);
    fit.upper_power(i) = upper_power(bins, i, best, 1 / std::sqrt(information(i, i)));
  }
  judge_fit(bins, best.power, slope, fit);
  return fit;
}

}  // namespace plumbline
