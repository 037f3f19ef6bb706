#include "rig/sim/drive_settings.h"

namespace plumbline::sim {
namespace {

constexpr rig::Range kPositive = {.min = 1e-9};
constexpr rig::Range kNotNegative = {.min = 0};

void read_axis(rig::StrictTable table, AxisDynamics& axis) {
  const auto read = [&](const char* key, double& value, rig::Range range) {
    value = table.number_or(key, value, range);
  };
  read("speed_deg_s", axis.speed_deg_s, kPositive);
  read("acceleration_deg_s2", axis.acceleration_deg_s2, kPositive);
  read("overshoot_deg", axis.overshoot_deg, kNotNegative);
  read("settling_hz", axis.settling_hz, kPositive);
  read("settling_tau_s", axis.settling_tau_s, kPositive);
  read("encoder_resolution_deg", axis.encoder_resolution_deg, kNotNegative);
  read("in_position_window_deg", axis.in_position_window_deg, kPositive);
  read("in_position_hold_s", axis.in_position_hold_s, kNotNegative);
  read("lower_limit_deg", axis.lower_limit_deg, {});
  read("upper_limit_deg", axis.upper_limit_deg, {});
  read("home_offset_deg", axis.home_offset_deg, {});
  read("power_on_deg", axis.power_on_deg, {});
  read("home_switch_deg", axis.home_switch_deg, {});
  read("homing_speed_deg_s", axis.homing_speed_deg_s, kPositive);
  for (const double inside : {axis.power_on_deg, axis.home_switch_deg}) {
    if (inside <= axis.lower_limit_deg || inside >= axis.upper_limit_deg) {
      table.refuse("upper_limit_deg",
                   "power_on_deg and home_switch_deg must lie between lower and upper limit");
    }
  }
}

}  // namespace

DriveSettings read_drive(rig::StrictTable table) {
  DriveSettings drive;
  drive.unit_id = static_cast<int>(table.integer_or("unit_id", drive.unit_id, {1, 247}));
  drive.serial_number = static_cast<std::uint32_t>(
      table.integer_or("serial_number", drive.serial_number, {0, 4294967295.0}));
  drive.high_word_first =
      table.choice_or("word_order", "high_first", {"high_first", "low_first"}) == "high_first";
  const double counts = table.number_or("counts_per_deg", drive.counts_per_deg[0], {1, 1e6});
  drive.counts_per_deg = {counts, counts};
  drive.following_error_deg =
      table.number_or("following_error_deg", drive.following_error_deg, kPositive);
  read_axis(table.table("delta"), drive.axis[0]);
  read_axis(table.table("h"), drive.axis[1]);
  return drive;
}

}  // namespace plumbline::sim
