#include "rig/sim/axis.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

namespace plumbline::sim {
namespace {

// A very short move cannot excite the full oscillation; without this bound a correction of one
// encoder step would ring a hundred times wider than the step.
constexpr double kLargestOvershootShare = 0.1;

double limited(double wanted, double largest) {
  return wanted > 0 ? std::min(wanted, largest) : largest;
}

}  // namespace

Axis::Axis(const AxisDynamics& dynamics)
    : dynamics_(dynamics),
      deceleration_deg_s2_(dynamics.acceleration_deg_s2),
      true_minus_encoder_(dynamics.power_on_deg) {
  assert(dynamics.speed_deg_s > 0 && dynamics.acceleration_deg_s2 > 0);
}

void Axis::begin(double t_s, double rest_deg) {
  phases_ = 0;
  end_s_ = t_s;
  end_deg_ = rest_deg;
  blocked_deg_.reset();
}

Axis::Point Axis::append(Point from, double duration_s, double acceleration_deg_s2) {
  phase_.at(phases_++) = {end_s_, duration_s, from.deg, from.deg_s, acceleration_deg_s2};
  end_s_ += duration_s;
  end_deg_ =
      from.deg + from.deg_s * duration_s + 0.5 * acceleration_deg_s2 * duration_s * duration_s;
  return {end_deg_, from.deg_s + acceleration_deg_s2 * duration_s};
}

void Axis::start_move(double t_s, double target_deg, double speed_deg_s, double acceleration_deg_s2,
                      double deceleration_deg_s2) {
  stop(t_s);
  const double speed = limited(speed_deg_s, dynamics_.speed_deg_s);
  const double acceleration = limited(acceleration_deg_s2, dynamics_.acceleration_deg_s2);
  deceleration_deg_s2_ = limited(deceleration_deg_s2, dynamics_.acceleration_deg_s2);

  const double travel = target_deg - end_deg_;
  const double distance = std::abs(travel);
  const double direction = std::copysign(1.0, travel);
  // v²/2a + v²/2b = distance gives the peak of a move too short to reach its speed.
  const double reachable = std::sqrt(2 * distance * acceleration * deceleration_deg_s2_ /
                                     (acceleration + deceleration_deg_s2_));
  const double peak = std::min(speed, reachable);
  const double ramps_deg = 0.5 * peak * peak * (1 / acceleration + 1 / deceleration_deg_s2_);
  if (peak > 0) {
    Point point = append({end_deg_, 0}, peak / acceleration, direction * acceleration);
    point = append(point, std::max(0.0, distance - ramps_deg) / peak, 0);
    append(point, peak / deceleration_deg_s2_, -direction * deceleration_deg_s2_);
  }
  target_deg_ = target_deg;
  end_deg_ = target_deg;  // free of the rounding of the sums above
  finish(travel);
}

void Axis::stop(double t_s) {
  const Point from = blocked_deg_ ? Point{*blocked_deg_, 0} : profile(t_s);
  begin(t_s, from.deg);
  if (from.deg_s != 0) {
    append(from, std::abs(from.deg_s) / deceleration_deg_s2_,
           -std::copysign(deceleration_deg_s2_, from.deg_s));
  }
  finish(end_deg_ - from.deg);
}

void Axis::finish(double travel_deg) {
  // e^(−t/τ)·sin(ωt) has its first peak at ωt = atan(ωτ); scaled so that this peak is the
  // overshoot.
  const double omega = 2 * std::numbers::pi * dynamics_.settling_hz;
  const double tau = dynamics_.settling_tau_s;
  const double overshoot =
      std::min(dynamics_.overshoot_deg, kLargestOvershootShare * std::abs(travel_deg));
  const double phase = std::atan(omega * tau);
  const double peak = std::exp(-phase / (omega * tau)) * std::sin(phase);
  const double amplitude = overshoot > 0 ? overshoot / peak : 0;
  ringing_amplitude_deg_ = std::copysign(amplitude, travel_deg);
  const double envelope_s = amplitude > dynamics_.in_position_window_deg
                                ? tau * std::log(amplitude / dynamics_.in_position_window_deg)
                                : 0;
  settled_s_ = end_s_ + envelope_s + dynamics_.in_position_hold_s;
}

void Axis::block(double t_s) {
  if (!blocked_deg_) blocked_deg_ = profile(t_s).deg + ringing_deg(t_s);
}

void Axis::freeze(double t_s) {
  const double here = blocked_deg_.value_or(profile(t_s).deg);
  begin(t_s, here);
  ringing_amplitude_deg_ = 0;
  settled_s_ = t_s + dynamics_.in_position_hold_s;
}

void Axis::slip(double deg) { true_minus_encoder_ -= deg; }

void Axis::reference(double t_s) {
  assert(!at(t_s).moving);
  const double true_deg = profile(t_s).deg + true_minus_encoder_;
  true_minus_encoder_ = dynamics_.home_offset_deg;
  begin(t_s, true_deg - true_minus_encoder_);
  target_deg_ = end_deg_;
  finish(0);
}

Axis::Point Axis::profile(double t_s) const {
  if (t_s < end_s_) {
    for (std::size_t i = 0; i < phases_; ++i) {
      const Phase& phase = phase_.at(i);
      const double dt = t_s - phase.start_s;
      if (dt > phase.duration_s) continue;
      return {phase.start_deg + phase.start_deg_s * dt + 0.5 * phase.acceleration_deg_s2 * dt * dt,
              phase.start_deg_s + phase.acceleration_deg_s2 * dt};
    }
  }
  return {end_deg_, 0};
}

double Axis::ringing_deg(double t_s) const {
  const double after_s = t_s - end_s_;
  if (after_s <= 0) return 0;
  return ringing_amplitude_deg_ * std::exp(-after_s / dynamics_.settling_tau_s) *
         std::sin(2 * std::numbers::pi * dynamics_.settling_hz * after_s);
}

AxisState Axis::at(double t_s) const {
  const Point commanded = profile(t_s);
  const double shaft_deg = blocked_deg_.value_or(commanded.deg + ringing_deg(t_s));
  const double step = dynamics_.encoder_resolution_deg;
  AxisState state;
  state.angle_deg = shaft_deg + true_minus_encoder_;
  state.encoder_deg = step > 0 ? std::round(shaft_deg / step) * step : shaft_deg;
  state.commanded_deg = commanded.deg;
  state.speed_deg_s = blocked_deg_ ? 0 : commanded.deg_s;
  state.moving = t_s < end_s_;
  // A stopped or blocked axis has held still without being where it was sent.
  state.in_position =
      t_s >= settled_s_ && std::abs((blocked_deg_ ? *blocked_deg_ : end_deg_) - target_deg_) <=
                               dynamics_.in_position_window_deg;
  return state;
}

}  // namespace plumbline::sim
