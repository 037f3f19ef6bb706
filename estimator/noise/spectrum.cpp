#include "estimator/noise/spectrum.h"

#include <Eigen/Core>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace plumbline {

namespace {

std::size_t largest_smooth(std::size_t limit) {
  std::size_t best = 1;
  for (std::size_t fives = 1; fives <= limit; fives *= 5)
    for (std::size_t threes = fives; threes <= limit; threes *= 3) {
      std::size_t number = threes;
      while (number * 2 <= limit) number *= 2;
      best = std::max(best, number);
    }
  return best;
}

}  // namespace

std::vector<double> cosine_transform(const std::vector<double>& record) {
  if (record.empty()) return {};
  const std::size_t n = largest_smooth(record.size());
  // Makhoul (1980): even samples forward, odd samples backward, one complex FFT of length n.
  std::vector<std::complex<double>> folded(n);
  const double reference = record.front();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t to = i % 2 == 0 ? i / 2 : n - 1 - i / 2;
    folded[to] = record[i] - reference;
  }
  std::vector<std::complex<double>> spectrum(n);
  Eigen::FFT<double> fft;
  fft.fwd(spectrum, folded);
  std::vector<double> coefficient(n);
  const double scale = std::sqrt(2.0 / static_cast<double>(n));
  for (std::size_t k = 0; k < n; ++k) {
    const double angle = -std::numbers::pi * static_cast<double>(k) / (2 * static_cast<double>(n));
    coefficient[k] = scale * (std::polar(1.0, angle) * spectrum[k]).real();
  }
  coefficient[0] =
      coefficient[0] / std::numbers::sqrt2 + reference * std::sqrt(static_cast<double>(n));
  return coefficient;
}

std::vector<std::complex<double>> fourier_transform(const std::vector<double>& record,
                                                    std::size_t& length) {
  assert(record.size() >= 4);
  length = 4 * largest_smooth(record.size() / 4);
  const std::vector<double> beginning(record.begin(),
                                      record.begin() + static_cast<std::ptrdiff_t>(length));
  std::vector<std::complex<double>> spectrum;
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  fft.fwd(spectrum, beginning);
  return spectrum;
}

}  // namespace plumbline
