// The five noise terms of IEEE Std 952 at the level of samples.
#pragma once

#include <cstdint>
#include <vector>

#include "rig/sim/random.h"
#include "rig/sim/world.h"

namespace plumbline::sim {

/// Flicker noise is 1/f from here up to a quarter of the sample rate; below it is flat.
inline constexpr double kFlickerLowest_hz = 1e-5;

/// Exponentially correlated random process with mean 0 (Ornstein-Uhlenbeck, first-order
/// Gauss-Markov), exact for any time step.
class Wander {
 public:
  /// Starts in its stationary distribution.
  Wander(double standard_deviation, double tau_s, Random& random);
  /// The value dt_s later.
  double next(double dt_s, Random& random);
  double value() const { return value_; }

 private:
  double standard_deviation_;
  double tau_s_;
  double value_;
  double cached_dt_s_ = -1;
  double decay_ = 1;
  double kick_ = 0;
};

/// Noise of one output. Time may pass between samples in steps of any length.
class ChannelNoise {
 public:
  ChannelNoise(const NoiseTerms& terms, double rate_hz, std::uint64_t seed, std::size_t axis);
  /// Noise of a sample taken dt_s after the previous one, V.
  double next_V(double dt_s);

 private:
  NoiseTerms terms_;
  double rate_hz_;
  Random white_;
  Random slow_;
  std::vector<Wander> flicker_;  ///< corner frequencies a factor 4 apart, then the relaxations
  double rounding_ = 0;          ///< last error of the integrator behind quantization noise, in Q
  double random_walk_V_ = 0;
  double ramp_V_per_s_ = 0;
  double ramp_V_ = 0;
};

}  // namespace plumbline::sim
