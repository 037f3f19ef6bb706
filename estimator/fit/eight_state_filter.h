// Kalman filter of one axis: the four parameters and four states that carry the coloured noise
// (Kostyuk & Lakoza 2012, eq. 13–17, corrected).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/calibrate.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// Places of the states. Only U0, d_fn, d_rw and v1 are seen together by the measurement; v2 is the
/// derivative of v1 and is not.
enum EightState : Eigen::Index {
  kStateKx,
  kStateKy,
  kStateKz,
  kStateU0,
  kStateFlicker,
  kStateRandomWalk,
  kStateRamp,
  kStateRampRate,
  kEightStateCount
};

struct EightStateOptions {
  /// Prior of [K_ix K_iy K_iz U_i0]: wide enough to leave no trace after a few poses, finite so
  /// that the covariance keeps its digits.
  Eigen::Vector4d prior_mean = Eigen::Vector4d::Zero();
  Eigen::Vector4d prior_sd{1.0, 1.0, 1.0, 10.0};
  /// Random walk of the four parameters, V/g/√s and V/√s. Zero: the parameters are constants and
  /// the filter forgets nothing.
  Eigen::Vector4d parameter_walk = Eigen::Vector4d::Zero();
  /// Correlation time of the first-order Gauss-Markov process that stands in for flicker noise.
  double flicker_correlation_s = 100.0;
  /// Natural frequency of the second-order process that carries the ramp.
  double ramp_frequency_rad_s = 1e-3;
  /// The filter as eq. 13–15 print it, to show what the corrections are for: the matrices of
  /// continuous time taken for those of one step whatever its length, unit noise on the parameters
  /// (V/g and V a step), the ramp as −ω₀ and −√2ω₀ on the diagonal, v2 measured beside v1.
  bool as_printed = false;
};

/// What one measurement brought.
struct Innovation {
  double value_V = 0;
  double variance_V2 = 0;
  /// Normalised innovation squared; χ² with one degree of freedom when the model holds.
  double nis() const { return value_V * value_V / variance_V2; }
};

/// Variance, V², of the first-order Gauss-Markov process that stands in for flicker noise: equal
/// heights of the Allan plateau, which holds for about a decade of τ (IEEE Std 952, annex C).
double flicker_variance_V2(const NoiseModel& noise);

/// Linear in all eight states. Time steps may be uneven; each is discretised exactly: the three
/// noise processes and the parameters do not act on each other, so the matrix exponential is block
/// diagonal and Van Loan's integral is taken for each block. Lengths of steps count to 1 ns, and
/// what was worked out for a length is kept, so that samples that come unevenly cost no
/// exponential. A prediction with an update takes some 60 ns and no memory: samples can be taken
/// one by one as well as averaged.
class EightStateFilter {
 public:
  using State = Eigen::Matrix<double, kEightStateCount, 1>;
  using Covariance = Eigen::Matrix<double, kEightStateCount, kEightStateCount>;

  /// `noise` in V; its white and quantization terms are not states but belong to the variance that
  /// update() is given. Terms that are not present have no variance and stay at zero.
  EightStateFilter(const NoiseModel& noise, const EightStateOptions& options, double start_s);

  /// Carries state and covariance to time t_s ≥ the last one.
  void predict(double t_s);

  /// Takes a voltage measured at the predicted time under specific force a_g (standard g, sensor
  /// frame), with the variance of its uncorrelated error. Joseph form.
  Innovation update(const Eigen::Vector3d& a_g, double voltage_V, double variance_V2);

  const State& state() const { return x_; }
  const Covariance& covariance() const { return P_; }
  AxisEstimate parameters() const;

 private:
  /// Transition over one time step and the noise that enters during it.
  struct Step {
    std::int64_t length_ns = -1;
    /// State i + 4 becomes same[i]·itself + other[i]·(the other state of the ramp, i ≥ 2).
    std::array<double, 4> same{};
    std::array<double, 4> other{};
    std::array<double, kEightStateCount> noise{};  ///< variances that enter
    double noise_ramp = 0;                         ///< covariance of v1 and v2 that enters
  };
  Step discretise(std::int64_t length_ns) const;
  Step printed_step() const;
  const Step& step_of(std::int64_t length_ns);

  double flicker_rate_per_s_ = 0;
  double flicker_density_ = 0;  ///< driving density, V²/s
  double walk_density_ = 0;     ///< V²/s
  double walk_decay_per_s_ = 0;
  double ramp_density_ = 0;  ///< V²/s³
  double ramp_frequency_ = 0;
  Eigen::Vector4d parameter_density_;
  bool as_printed_ = false;
  double t_s_ = 0;
  unsigned updates_ = 0;
  State x_;
  Covariance P_;
  std::array<Step, 64> steps_;  ///< by a hash of their length
};

}  // namespace plumbline
