// A record's cosine spectrum, gathered into bins, and the shapes that noise terms have in it.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "estimator/noise/noise_model.h"

namespace plumbline {

/// Of the ramp in a record, U/s.
struct Slope {
  double value = 0;
  double variance = 0;
};

/// Coefficients first … first + width − 1 of a cosine spectrum (spectrum.h) taken together.
struct SpectrumSum {
  std::size_t first = 0;
  std::size_t width = 0;
  double count = 0;   ///< coefficients that take part: `width` but for masked ones
  double square = 0;  ///< Σc², U²
  double cross = 0;   ///< Σc·m, m the coefficient of a ramp of 1 U/s
  double ramp = 0;    ///< Σm²
};

/// The bins of a whole spectrum. Each is 3 % wide, and single coefficients at the lowest
/// frequencies.
struct SpectrumSums {
  std::size_t length = 0;  ///< coefficients in the spectrum, 0 included
  double rate_hz = 0;
  std::vector<SpectrumSum> bins;

  double duration_s() const { return static_cast<double>(length) / rate_hz; }
  double frequency_hz(double k) const { return 0.5 * rate_hz * k / static_cast<double>(length); }
};

/// Gathers spectrum `c` without the mean. Coefficients with `masked` set (empty: none) are left
/// out; frequencies above band_hz too.
SpectrumSums gather_spectrum(const std::vector<double>& c, double rate_hz,
                             const std::vector<bool>& masked = {},
                             double band_hz = std::numeric_limits<double>::infinity());

/// Variance of coefficient k of n for Q = 1. All of these: two-sided densities times the rate.
double quantization_variance(double k, std::size_t n, double rate_hz);
/// For B = 1. Flicker as a continuum of relaxation processes with corner frequencies from low_hz to
/// high_hz: 1/f in between, flat below, 1/f² above. 0 and infinity: 1/f everywhere.
double flicker_variance(double k, std::size_t n, double rate_hz, double low_hz, double high_hz);
/// For K = 1; a walk that forgets at the given rate, 0 for never.
double walk_variance(double k, std::size_t n, double rate_hz, double decay_per_s);
/// For a first-order Gauss-Markov process of variance 1 and correlation time tau_s.
double markov_variance(double k, std::size_t n, double rate_hz, double tau_s);

/// Mean over a bin of a density that changes by a few per cent within: Simpson's rule.
template <class Density>
double bin_mean(const SpectrumSum& bin, Density&& density) {
  const auto first = static_cast<double>(bin.first);
  if (bin.width == 1) return density(first);
  const double last = first + static_cast<double>(bin.width - 1);
  return (density(first) + 4 * density(0.5 * (first + last)) + density(last)) / 6;
}

}  // namespace plumbline
