// The room over time: temperature of air and sensor, humidity, supply, motor current.
#pragma once

#include <cstdint>

#include "rig/sim/noise.h"
#include "rig/sim/random.h"
#include "rig/sim/world.h"

namespace plumbline::sim {

/// True values at one instant.
struct RoomState {
  double air_C = 0;
  double temp_C = 0;  ///< of the sensor
  double rh_pct = 0;
  double supply_V = 0;
  double motor_A = 0;
};

/// Time moves forward in steps of any length.
class RoomProcess {
 public:
  RoomProcess(const Room& room, std::uint64_t seed);
  RoomState next(double t_s, double dt_s, double h_deg, bool moving);
  /// What the instruments of the rig show: the state with errors of reading.
  RoomState read(const RoomState& state);

 private:
  Room room_;
  Random random_;
  Random reading_;
  Wander air_;
  Wander humidity_;
  Wander supply_;
  Random motor_random_;
  Wander motor_;
  double lagged_C_ = 0;
  bool started_ = false;
};

}  // namespace plumbline::sim
