// The fewest positions of a plan that determine the parameters well enough.
#pragma once

#include "app/sequencer/plan.h"

namespace plumbline::app {

/// What is to be reached, m/s², input-referred.
struct PrecisionTarget {
  double u_mps2 = 0;        ///< of a measured component by the parameters, RMS over the sphere
  double pose_sd_mps2 = 0;  ///< error of a pose mean, independent from pose to pose
};

/// u against the number of positions, in the order of the plan and in the D-optimal one.
struct PrecisionStep {
  std::size_t positions = 0;
  double in_order_mps2 = 0;  ///< infinite while they do not determine the parameters
  double d_optimal_mps2 = 0;
};

struct ShortestPlan {
  Plan plan;  ///< soak and verification as before, of the grid only what is needed, in its order
  std::size_t positions = 0;           ///< of the grid
  std::size_t in_order_positions = 0;  ///< that the plan's own order would need; 0: all are too few
  double u_mps2 = 0;                   ///< reached
  std::vector<PrecisionStep> course;
};

/// Positions are taken D-optimally, each at most once, until the target is reached. Fails (input)
/// when even all of them do not reach it. `plan` was made with `options`.
Result<ShortestPlan> shortest_plan(const Plan& plan, const PlanOptions& options,
                                   const Gravity& gravity, const PrecisionTarget& target);

}  // namespace plumbline::app
