#include "estimator/fit/eight_state_filter.h"

#include <cassert>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

namespace plumbline {
namespace {

// A first-order Gauss-Markov process has its largest Allan deviation, 0.6174·σ_stationary, at
// τ = 1.89 correlation times (IEEE Std 952, annex C); flicker noise has the plateau B·√(2 ln2/π).
// Equal heights there make the process stand in for flicker over about a decade of τ.
constexpr double kGaussMarkovPeak = 0.6174;

double squared(double value) { return value * value; }

double coefficient(const NoiseTerm& term) { return term.present ? term.value : 0.0; }

}  // namespace

EightStateFilter::EightStateFilter(const NoiseModel& noise, const EightStateOptions& options,
                                   double start_s)
    : flicker_rate_per_s_(1.0 / options.flicker_correlation_s),
      walk_density_(squared(coefficient(noise.K))),
      walk_decay_per_s_(noise.walk_decay_per_s),
      ramp_frequency_(options.ramp_frequency_rad_s),
      parameter_density_(options.parameter_walk.cwiseAbs2()),
      t_s_(start_s) {
  assert(options.flicker_correlation_s > 0 && options.ramp_frequency_rad_s > 0);
  const double plateau_V =
      coefficient(noise.B) * std::sqrt(2.0 * std::numbers::ln2 / std::numbers::pi);
  const double flicker_variance = squared(plateau_V / kGaussMarkovPeak);
  flicker_density_ = 2.0 * flicker_rate_per_s_ * flicker_variance;
  const double slope_V_per_s = coefficient(noise.R);
  ramp_density_ = squared(slope_V_per_s) * ramp_frequency_;

  x_.setZero();
  x_.head<4>() = options.prior_mean;
  P_.setZero();
  P_.diagonal().head<4>() = options.prior_sd.cwiseAbs2();
  P_(kStateFlicker, kStateFlicker) = flicker_variance;
  // Random walk and ramp are counted from the start: their level is U0's. A walk that forgets has
  // been going on for long.
  if (walk_decay_per_s_ > 0)
    P_(kStateRandomWalk, kStateRandomWalk) = walk_density_ / (2.0 * walk_decay_per_s_);
  P_(kStateRampRate, kStateRampRate) = squared(slope_V_per_s);
}

EightStateFilter::Step EightStateFilter::discretise(double dt_s) const {
  Step step;
  step.dt_s = dt_s;
  step.F.setIdentity();
  step.Q.setZero();
  step.Q.diagonal().head<4>() = parameter_density_ * dt_s;

  const double decay = std::exp(-flicker_rate_per_s_ * dt_s);
  step.F(kStateFlicker, kStateFlicker) = decay;
  step.Q(kStateFlicker, kStateFlicker) = -flicker_density_ / (2.0 * flicker_rate_per_s_) *
                                         std::expm1(-2.0 * flicker_rate_per_s_ * dt_s);
  step.F(kStateRandomWalk, kStateRandomWalk) = std::exp(-walk_decay_per_s_ * dt_s);
  step.Q(kStateRandomWalk, kStateRandomWalk) =
      walk_density_ * (walk_decay_per_s_ > 0 ? -std::expm1(-2.0 * walk_decay_per_s_ * dt_s) /
                                                   (2.0 * walk_decay_per_s_)
                                             : dt_s);

  // Van Loan (1978): exp([−A G; 0 Aᵀ]·dt) = [· A⁻G; 0 Φᵀ].
  Eigen::Matrix2d A;
  A << 0.0, 1.0, -squared(ramp_frequency_), -std::numbers::sqrt2 * ramp_frequency_;
  Eigen::Matrix4d block = Eigen::Matrix4d::Zero();
  block.topLeftCorner<2, 2>() = -A;
  block(1, 3) = 1.0;
  block.bottomRightCorner<2, 2>() = A.transpose();
  const Eigen::Matrix4d exponential = (block * dt_s).exp();
  const Eigen::Matrix2d F = exponential.bottomRightCorner<2, 2>().transpose();
  const Eigen::Matrix2d Q = ramp_density_ * F * exponential.topRightCorner<2, 2>();
  step.F.bottomRightCorner<2, 2>() = F;
  step.Q.bottomRightCorner<2, 2>() = 0.5 * (Q + Q.transpose());
  return step;
}

void EightStateFilter::predict(double t_s) {
  assert(t_s >= t_s_);
  const double dt_s = t_s - t_s_;
  t_s_ = t_s;
  if (dt_s != step_.dt_s) step_ = discretise(dt_s);
  x_ = step_.F * x_;
  const Covariance carried = step_.F * P_ * step_.F.transpose() + step_.Q;
  P_ = carried;
}

Innovation EightStateFilter::update(const Eigen::Vector3d& a_g, double voltage_V,
                                    double variance_V2) {
  State h = State::Zero();
  h.head<3>() = a_g;
  h(kStateU0) = h(kStateFlicker) = h(kStateRandomWalk) = h(kStateRamp) = 1.0;

  const State Ph = P_ * h;
  const Innovation innovation{voltage_V - h.dot(x_), h.dot(Ph) + variance_V2};
  const State gain = Ph / innovation.variance_V2;
  x_ += gain * innovation.value_V;
  const Covariance keep = Covariance::Identity() - gain * h.transpose();
  const Covariance updated = keep * P_ * keep.transpose() + gain * variance_V2 * gain.transpose();
  P_ = 0.5 * (updated + updated.transpose());
  return innovation;
}

AxisEstimate EightStateFilter::parameters() const {
  return {x_.head<4>(), P_.topLeftCorner<4, 4>()};
}

}  // namespace plumbline
