#include "estimator/noise/spectrum_sums.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace plumbline {

namespace {

/// 2·sin and 2·cos of half the angle of coefficient k.
double half_sine(double k, std::size_t n) {
  return 2 * std::sin(0.5 * std::numbers::pi * k / static_cast<double>(n));
}

/// Variance of flicker coefficient k relative to its density at that frequency: the ends of the
/// record take a little away. Closed form with the sine integral, (2/π)(Si(πk) − (1−(−1)^k)/(πk)).
double flicker_end_factor(double k) {
  constexpr std::array<double, 4> kFirst = {0, 0.773669, 0.902823, 0.931095};
  const auto whole = static_cast<std::size_t>(std::lround(k));
  if (whole < kFirst.size()) return kFirst[whole];
  const double x = std::numbers::pi * k;
  const double sign = whole % 2 == 0 ? 1 : -1;
  return 1 - 2 / (std::numbers::pi * x) + sign * 4 / (std::numbers::pi * x * x * x);
}

}  // namespace

SpectrumSums gather_spectrum(const std::vector<double>& c, double rate_hz,
                             const std::vector<bool>& masked, double band_hz) {
  SpectrumSums sums;
  sums.length = c.size();
  sums.rate_hz = rate_hz;
  const double n = static_cast<double>(c.size());
  const double highest = 2 * band_hz * n / rate_hz;
  const std::size_t end =
      highest < n ? std::max<std::size_t>(2, static_cast<std::size_t>(highest)) : c.size();
  for (std::size_t k = 1; k < end;) {
    SpectrumSum bin;
    bin.first = k;
    bin.width = std::min(std::max<std::size_t>(1, k / 32), end - k);
    for (std::size_t i = k; i < k + bin.width; ++i) {
      if (!masked.empty() && masked[i]) continue;
      bin.count += 1;
      bin.square += c[i] * c[i];
      if (i % 2 == 0) continue;
      // DCT-II of t = iT: closed form, zero for even coefficients.
      const double half = 0.5 * std::numbers::pi * static_cast<double>(i) / n;
      const double sine = std::sin(half);
      const double m = -std::sqrt(2 / n) * std::cos(half) / (2 * sine * sine) / rate_hz;
      bin.cross += c[i] * m;
      bin.ramp += m * m;
    }
    if (bin.count > 0) sums.bins.push_back(bin);
    k += bin.width;
  }
  return sums;
}

double quantization_variance(double k, std::size_t n, double rate_hz) {
  const double s = half_sine(k, n);
  // Interior increments, and the two ends that have no partner.
  return (s * s + (4 - s * s) / static_cast<double>(n)) * rate_hz * rate_hz;
}

double flicker_variance(double k, std::size_t n, double rate_hz, double low_hz, double high_hz) {
  const double f_hz = 0.5 * rate_hz * k / static_cast<double>(n);
  double part = 1;
  if (low_hz > 0) part -= 2 / std::numbers::pi * std::atan(low_hz / f_hz);
  if (std::isfinite(high_hz)) part -= 2 / std::numbers::pi * std::atan(f_hz / high_hz);
  return part * flicker_end_factor(k) / half_sine(k, n);
}

double walk_variance(double k, std::size_t n, double rate_hz, double decay_per_s) {
  const double s = half_sine(k, n);
  // The walk keeps the part `kept` of itself from sample to sample.
  const double kept = std::exp(-decay_per_s / rate_hz);
  const double driving =
      decay_per_s > 0 ? -std::expm1(-2 * decay_per_s / rate_hz) / (2 * decay_per_s) : 1 / rate_hz;
  return driving / ((1 - kept) * (1 - kept) + kept * s * s);
}

double markov_variance(double k, std::size_t n, double rate_hz, double tau_s) {
  const double s = half_sine(k, n);
  const double lost = -std::expm1(-1 / (tau_s * rate_hz));
  const double kept = 1 - lost;
  return lost * (1 + kept) / (lost * lost + kept * s * s);
}

}  // namespace plumbline
