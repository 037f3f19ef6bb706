// What a run will do, step by step: can be printed, checked and timed without any hardware.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/measurement.h"
#include "rig/dividing_head.h"
#include "storage/run_store.h"

namespace plumbline::app {

enum class VisitOrder { raster, snake, spiral, random };

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

Plan make_plan(const Grid& grid, const PlanOptions& options, double rate_hz);
/// Refuses the first step (via positions included) outside the limits, by number and angle.
Result<void> check_plan(const Plan& plan, const rig::SoftLimits& limits);
PlanTime time_plan(const Plan& plan, const AxisMotion& motion, double rate_hz,
                   double settle_s_per_pose);
/// One line per step: ordinal,kind,delta_deg,h_deg,samples,via
std::string to_csv(const Plan& plan);

}  // namespace plumbline::app
