#include "app/station/running_fit.h"

#include <cmath>

#include "estimator/angle_units.h"
#include "estimator/fit/least_squares.h"
#include "estimator/kinematics.h"

namespace plumbline::app {

namespace {

constexpr Eigen::Index kParameters = 4;

}  // namespace

std::optional<PerAxis<RunningAxis>> running_fit(const std::vector<PoseMean>& poses, double gamma) {
  const auto n = static_cast<Eigen::Index>(poses.size());
  if (n <= kParameters) return std::nullopt;
  Eigen::MatrixXd A(n, kParameters);
  for (Eigen::Index i = 0; i < n; ++i) {
    const rig::HeadAngles& at = poses[static_cast<std::size_t>(i)].target;
    const HeadGeometry head{.delta_rad = at.delta_deg * kRadPerDeg, .h_rad = at.h_deg * kRadPerDeg};
    A.row(i) << specific_force_g(head, gamma).transpose(), 1.0;
  }
  PerAxis<RunningAxis> fit;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    Eigen::VectorXd b(n);
    for (Eigen::Index i = 0; i < n; ++i) b[i] = poses[static_cast<std::size_t>(i)].mean_V[axis];
    // Poses on one circle look almost, not quite, as if they told everything.
    const LeastSquaresResult found = solve_least_squares(A, b, {.rank_tolerance = 1e-6});
    const double scale = found.x[static_cast<Eigen::Index>(axis)];
    if (found.rank < kParameters || scale == 0) return std::nullopt;
    RunningAxis& result = fit[axis];
    const double variance =
        found.residual_sum_of_squares / static_cast<double>(found.degrees_of_freedom);
    for (Eigen::Index j = 0; j < kParameters; ++j) {
      result.value[static_cast<std::size_t>(j)] = found.x[j];
      result.u[static_cast<std::size_t>(j)] = std::sqrt(variance * found.cofactor(j, j));
    }
    const double to_mps2 = kStandardGravity_mps2 / scale;
    for (const double residual_V : found.residual) {
      result.residual_mps2.push_back(residual_V * to_mps2);
    }
    result.rms_mps2 =
        std::sqrt(found.residual_sum_of_squares / static_cast<double>(n)) * std::abs(to_mps2);
  }
  return fit;
}

PerAxis<double> pooled_sd_V(const std::vector<PoseMean>& poses) {
  PerAxis<double> sum{};
  double dof = 0;
  for (const PoseMean& pose : poses) {
    if (pose.samples < 2) continue;
    const auto weight = static_cast<double>(pose.samples - 1);
    dof += weight;
    for (std::size_t i = 0; i < kAxisCount; ++i) sum[i] += weight * pose.sd_V[i] * pose.sd_V[i];
  }
  for (double& value : sum) value = dof > 0 ? std::sqrt(value / dof) : std::nan("");
  return sum;
}

Json running_fit_json(const PerAxis<RunningAxis>& fit) {
  return json_per_axis([&](std::size_t axis) -> Json {
    const RunningAxis& row = fit[axis];
    return {{"value", json_numbers({row.value.begin(), row.value.end()})},
            {"u", json_numbers({row.u.begin(), row.u.end()})},
            {"rms_mps2", json_number(row.rms_mps2)}};
  });
}

}  // namespace plumbline::app
