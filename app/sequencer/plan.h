// What a run will do, step by step: can be printed, checked and timed without any hardware.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"
#include "rig/dividing_head.h"
#include "storage/run_store.h"

namespace plumbline::app {

/// How the nodes of the grid are strung together.
enum class VisitOrder {
  raster,  ///< ring by ring (one h each), every ring from the smallest δ
  snake,   ///< ring by ring, to and fro
  spiral,  ///< ring by ring, the spindle turning on in one direction: δ goes beyond 360°
  random,  ///< shuffled: costs travel, but keeps a drift apart from the position
};
const char* to_string(VisitOrder order);
/// In the order of the enumerators, for configuration and command line.
const std::vector<std::string>& visit_order_names();
/// Empty when `name` is none of visit_order_names().
std::optional<VisitOrder> visit_order_from(std::string_view name);

/// [plan] of rig.toml.
struct PlanOptions {
  VisitOrder order = VisitOrder::snake;
  bool one_sided = false;     ///< every position approached in positive δ direction
  double approach_deg = 2.0;  ///< overshoot used for a one-sided approach
  double soak_s = 600;        ///< static record before the grid; 0 = none
  double soak_delta_deg = 0;
  double soak_h_deg = 0;
  int samples_per_pose = 40;
  int verification_poses = 24;  ///< at random angles off the grid; 0 = none
  std::uint64_t seed = 1;       ///< of random order and verification angles
};

/// One stop of the head. `via` positions are passed through on the way (one-sided approach).
struct PlanStep {
  long long ordinal = 0;
  storage::PoseKind kind = storage::PoseKind::grid;
  rig::HeadAngles target;
  std::vector<rig::HeadAngles> via;
  int samples = 0;
};

struct Plan {
  std::vector<PlanStep> steps;
};

struct AxisMotion {
  double speed_deg_s = 30;
  double acceleration_deg_s2 = 60;
};

struct PlanTime {
  double moving_s = 0;
  double sampling_s = 0;
  double settling_s = 0;
  double total_s() const { return moving_s + sampling_s + settling_s; }
};

/// Soak (when asked for), every node of the grid once, verification poses (when asked for).
/// Verification angles lie within the grid's span, rounded to 0.01°, at least 1° (or a quarter of a
/// narrower step) from every node; a grid of a single node leaves no room for any. Deterministic in
/// its arguments.
Plan make_plan(const Grid& grid, const PlanOptions& options, double rate_hz);

/// Refuses the first position (those passed through included) outside the limits, by step number
/// and angle. ErrorCode::input.
Result<void> check_plan(const Plan& plan, const rig::SoftLimits& limits);

/// Seconds that one axis needs from rest to rest: trapezoidal speed profile, a triangle when the
/// way is shorter than v²/a.
double travel_s(double way_deg, const AxisMotion& motion);
/// Both axes start together; the one that takes longer counts.
double travel_s(const rig::HeadAngles& from, const rig::HeadAngles& to, const AxisMotion& motion);

/// Starts with the head at the first step's target: homing and the way from there are not counted.
PlanTime time_plan(const Plan& plan, const AxisMotion& motion, double rate_hz,
                   double settle_s_per_pose);

/// A header and one line per step: ordinal,kind,delta_deg,h_deg,samples,via. `via` holds positions
/// as "δ:h", separated by blanks. Numbers are printed so that they read back unchanged.
std::string to_csv(const Plan& plan);

}  // namespace plumbline::app
