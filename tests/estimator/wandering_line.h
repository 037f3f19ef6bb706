// A sine whose amplitude and phase wander, as machines nearby make it.
#pragma once

#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

namespace plumbline {

/// A course of variance 1 whose spectrum about f_hz is half as high ±width_hz beside it, from 0 to
/// duration_s.
inline std::function<double(double t_s)> wandering_line(double f_hz, double width_hz,
                                                        double duration_s,
                                                        std::mt19937_64& random) {
  constexpr double kStep_s = 1;  // it hardly wanders in that time
  std::normal_distribution<double> normal;
  const double kept = std::exp(-2 * std::numbers::pi * width_hz * kStep_s);
  std::vector<std::complex<double>> phasor = {{normal(random), normal(random)}};
  for (double t_s = 0; t_s < duration_s + kStep_s; t_s += kStep_s) {
    const std::complex<double> next(normal(random), normal(random));
    phasor.push_back(kept * phasor.back() + std::sqrt(1 - kept * kept) * next);
  }
  return [phasor, f_hz](double t_s) {
    const double place = t_s / kStep_s;
    const auto k = static_cast<std::size_t>(place);
    const double part = place - static_cast<double>(k);
    return std::real(((1 - part) * phasor.at(k) + part * phasor.at(k + 1)) *
                     std::polar(1.0, 2 * std::numbers::pi * f_hz * t_s));
  };
}

}  // namespace plumbline
