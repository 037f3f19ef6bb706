// [drive] of world.toml: the motor drive of the simulated head and the mechanics of its axes.
#pragma once

#include <array>
#include <cstdint>

#include "rig/sim/axis.h"
#include "rig/strict_toml.h"

namespace plumbline::sim {

/// Index 0 is the spindle δ, index 1 the tilt h.
struct DriveSettings {
  int unit_id = 1;
  std::uint32_t serial_number = 31415;
  bool high_word_first = true;
  std::array<double, 2> counts_per_deg = {10000, 10000};
  double following_error_deg = 0.5;  ///< raises alarm 10h
  std::array<AxisDynamics, 2> axis = {
      AxisDynamics{},
      AxisDynamics{.lower_limit_deg = -95, .upper_limit_deg = 95, .power_on_deg = 2}};
};

/// Reads [drive], [drive.delta] and [drive.h]; absent keys keep the defaults above.
DriveSettings read_drive(rig::StrictTable table);

}  // namespace plumbline::sim
