#include "app/sequencer/shortest_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "estimator/kinematics.h"
#include "estimator/position_design.h"

namespace plumbline::app {
namespace {

/// 0 when it is never reached.
std::size_t first_within(const Eigen::VectorXd& u, double limit) {
  for (Eigen::Index n = 0; n < u.size(); ++n)
    if (u(n) <= limit) return static_cast<std::size_t>(n) + 1;
  return 0;
}

/// Numbers of positions worth a line: 4, 5, 6, 8, 10, 12, 16 … and all.
std::vector<std::size_t> worth_showing(std::size_t all, std::size_t needed) {
  std::vector<std::size_t> numbers;
  for (std::size_t octave = 4; octave <= all; octave *= 2)
    for (const std::size_t n : {octave, octave * 5 / 4, octave * 3 / 2})
      if (n <= all) numbers.push_back(n);
  numbers.push_back(needed);
  numbers.push_back(all);
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

}  // namespace

Result<ShortestPlan> shortest_plan(const Plan& plan, const PlanOptions& options,
                                   const Gravity& gravity, const PrecisionTarget& target) {
  std::vector<std::size_t> grid_steps;
  for (std::size_t k = 0; k < plan.steps.size(); ++k)
    if (plan.steps[k].kind == storage::PoseKind::grid) grid_steps.push_back(k);
  const double gamma = gravity.local_mps2 / kStandardGravity_mps2;
  Eigen::MatrixXd A(std::ssize(grid_steps), 4);
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    const rig::HeadAngles& at = plan.steps[grid_steps[static_cast<std::size_t>(row)]].target;
    A.row(row) << specific_force(at.delta_deg, at.h_deg, gamma).a_g.transpose(), 1;
  }
  std::vector<Eigen::Index> in_order(grid_steps.size());
  std::iota(in_order.begin(), in_order.end(), Eigen::Index{0});
  const std::vector<Eigen::Index> best = d_optimal_order(A);
  const Eigen::VectorXd u_in_order = target.pose_sd_mps2 * sphere_uncertainty(A, in_order);
  const Eigen::VectorXd u_best = target.pose_sd_mps2 * sphere_uncertainty(A, best);

  ShortestPlan result;
  result.positions = first_within(u_best, target.u_mps2);
  result.in_order_positions = first_within(u_in_order, target.u_mps2);
  if (result.positions == 0) {
    return fail(ErrorCode::input,
                fmt::format("all {} positions of the grid reach {:.3g} m/s², not {:.3g} m/s²: take "
                            "more samples a pose or a finer grid",
                            grid_steps.size(), u_best(u_best.size() - 1), target.u_mps2));
  }
  result.u_mps2 = u_best(static_cast<Eigen::Index>(result.positions) - 1);
  for (const std::size_t n : worth_showing(grid_steps.size(), result.positions)) {
    const auto at = static_cast<Eigen::Index>(n) - 1;
    result.course.push_back({n, u_in_order(at), u_best(at)});
  }

  std::vector<bool> taken(plan.steps.size(), false);
  for (std::size_t n = 0; n < result.positions; ++n)
    taken[grid_steps[static_cast<std::size_t>(best[n])]] = true;
  for (std::size_t k = 0; k < plan.steps.size(); ++k) {
    PlanStep step = plan.steps[k];
    if (step.kind == storage::PoseKind::grid && !taken[k]) continue;
    // What lay before it may be gone.
    std::vector<PlanStep>& steps = result.plan.steps;
    step.ordinal = std::ssize(steps);
    step.via.clear();
    if (options.one_sided &&
        (steps.empty() || step.target.delta_deg < steps.back().target.delta_deg))
      step.via.push_back({step.target.delta_deg - options.approach_deg, step.target.h_deg});
    steps.push_back(std::move(step));
  }
  return result;
}

}  // namespace plumbline::app
