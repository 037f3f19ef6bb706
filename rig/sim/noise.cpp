#include "rig/sim/noise.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace plumbline::sim {

Wander::Wander(double standard_deviation, double tau_s, Random& random)
    : standard_deviation_(standard_deviation),
      tau_s_(tau_s),
      value_(standard_deviation * random.normal()) {}

double Wander::next(double dt_s, Random& random) {
  if (dt_s != cached_dt_s_) {
    cached_dt_s_ = dt_s;
    decay_ = std::exp(-dt_s / tau_s_);
    kick_ = standard_deviation_ * std::sqrt(-std::expm1(-2 * dt_s / tau_s_));
  }
  value_ = decay_ * value_ + kick_ * random.normal();
  return value_;
}

namespace {

constexpr double kCornerRatio = 4;

}  // namespace

ChannelNoise::ChannelNoise(const NoiseTerms& terms, double rate_hz, std::uint64_t seed,
                           std::size_t axis)
    : terms_(terms),
      rate_hz_(rate_hz),
      white_(seed, fmt::format("noise.white.{}", axis)),
      slow_(seed, fmt::format("noise.slow.{}", axis)) {
  // A process of variance s² and corner frequency f_c has S(f) = (s²/π)·f_c/(f_c² + f²). With
  // corners spaced by Δ in ln f their sum is s²/(2Δ·f); it must be (B²/2π)/f. At a factor of 4
  // the ripple about that is 0.3 %.
  if (terms.B > 0) {
    const double variance = terms.B * terms.B * std::log(kCornerRatio) / std::numbers::pi;
    double corner_hz = rate_hz / 4;
    while (corner_hz > kFlickerLowest_hz) {
      flicker_.emplace_back(std::sqrt(variance), 1 / (2 * std::numbers::pi * corner_hz), slow_);
      corner_hz /= kCornerRatio;
    }
  }
  if (terms.relaxation > 0) {
    for (const double tau_s : terms.relaxation_tau_s)
      flicker_.emplace_back(terms.relaxation, tau_s, slow_);
  }
  ramp_V_per_s_ = slow_.sign() * terms.R;
}

double ChannelNoise::next_V(double dt_s) {
  double noise_V = 0;
  if (terms_.N > 0) noise_V += terms_.N * std::sqrt(rate_hz_) * white_.normal();
  if (terms_.Q > 0) {
    // A rounded integral, differenced: the rounding error is uniform with variance Q².
    const double rounding = white_.uniform(-std::numbers::sqrt3, std::numbers::sqrt3);
    noise_V += terms_.Q * rate_hz_ * (rounding - rounding_);
    rounding_ = rounding;
  }
  for (Wander& process : flicker_) noise_V += process.next(dt_s, slow_);
  if (terms_.K > 0) random_walk_V_ += terms_.K * std::sqrt(dt_s) * slow_.normal();
  ramp_V_ += ramp_V_per_s_ * dt_s;
  return noise_V + random_walk_V_ + ramp_V_;
}

}  // namespace plumbline::sim
