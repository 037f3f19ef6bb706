#include "rig/sim/room.h"

#include <cmath>
#include <numbers>

namespace plumbline::sim {

namespace {

double cycle(double amplitude, double t_s, double period_s, double phase_deg = 0) {
  return amplitude * std::sin(2 * std::numbers::pi * (t_s / period_s + phase_deg / 360.0));
}

}  // namespace

RoomProcess::RoomProcess(const Room& room, std::uint64_t seed)
    : room_(room),
      random_(seed, "room"),
      reading_(seed, "room.reading"),
      air_(room.wander_C, room.wander_tau_s, random_),
      humidity_(room.rh_wander_pct, room.rh_wander_tau_s, random_),
      supply_(room.supply_wander_V, room.supply_wander_tau_s, random_),
      motor_random_(seed, "room.motor"),
      motor_(room.motor_wander_A, room.motor_wander_tau_s, motor_random_) {}

RoomState RoomProcess::next(double t_s, double dt_s, double h_deg, bool moving) {
  RoomState state;
  state.air_C = room_.temperature_C + room_.drift_C_per_h * t_s / 3600 +
                cycle(room_.cycle_C, t_s, room_.cycle_period_s, room_.cycle_phase_deg) +
                air_.next(dt_s, random_);
  if (!started_) lagged_C_ = state.air_C;
  started_ = true;
  if (room_.sensor_lag_s > 0) {
    lagged_C_ += (state.air_C - lagged_C_) * -std::expm1(-dt_s / room_.sensor_lag_s);
  } else {
    lagged_C_ = state.air_C;
  }
  state.temp_C = lagged_C_ + room_.self_heating_C * -std::expm1(-t_s / room_.self_heating_tau_s);
  state.rh_pct = room_.rh_pct + cycle(room_.rh_cycle_pct, t_s, room_.rh_cycle_period_s) +
                 humidity_.next(dt_s, random_);
  state.motor_A = room_.hold_A + (moving ? room_.move_A : 0.0) +
                  room_.lift_A * std::cos(h_deg * std::numbers::pi / 180) +
                  motor_.next(dt_s, motor_random_);
  state.supply_V = room_.supply_V + cycle(room_.supply_cycle_V, t_s, room_.supply_cycle_period_s) +
                   supply_.next(dt_s, random_) - room_.supply_drop_V_per_A * state.motor_A;
  return state;
}

RoomState RoomProcess::read(const RoomState& state) {
  RoomState shown = state;
  shown.temp_C += room_.thermometer_offset_C + room_.thermometer_noise_C * reading_.normal();
  shown.rh_pct += room_.rh_noise_pct * reading_.normal();
  shown.supply_V += room_.supply_noise_V * reading_.normal();
  shown.motor_A += room_.motor_noise_A * reading_.normal();
  return shown;
}

}  // namespace plumbline::sim
