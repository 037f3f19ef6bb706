#include "app/certificate/budget.h"

#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "estimator/angle_units.h"
#include "estimator/kinematics.h"

namespace plumbline::app {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Root of the summed squares of the change of one parameter by 1″ at every pose, for δ and for h.
struct AngleSensitivity {
  double delta = 0;
  double h = 0;
};

AngleSensitivity angle_sensitivity(const Calibration& calibration,
                                   const RunDescription& description, std::size_t axis,
                                   Eigen::Index column) {
  const auto n = static_cast<Eigen::Index>(calibration.pose_results.size());
  if (n < 4) return {};
  const double gamma = description.gravity.local_mps2 / kStandardGravity_mps2;
  const Eigen::Vector3d K = calibration.final.batch_ls[axis].value.head<3>();
  Eigen::MatrixXd A(n, 4);
  Eigen::VectorXd by_delta(n), by_h(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Pose& pose = calibration.pose_results[static_cast<std::size_t>(k)].pose;
    const SpecificForce force = specific_force(pose.delta_deg, pose.h_deg, gamma);
    A.row(k) << force.a_g.transpose(), 1.0;
    by_delta(k) = K.dot(force.d_delta_g_per_rad) * kRadPerArcsec;
    by_h(k) = K.dot(force.d_h_g_per_rad) * kRadPerArcsec;
  }
  const Eigen::MatrixXd gain = A.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::VectorXd row = gain.row(column).transpose();
  return {row.cwiseProduct(by_delta).norm(), row.cwiseProduct(by_h).norm()};
}

}  // namespace

Budget budget_of(const Calibration& calibration, const RunDescription& description,
                 std::size_t axis, Eigen::Index column) {
  const AxisEstimate& estimate = calibration.final.batch_ls[axis];
  Budget budget;
  budget.axis = axis;
  budget.column = column;
  budget.value = estimate.value(column);
  const double variance = std::max(0.0, estimate.covariance(column, column));
  budget.u = std::sqrt(variance);

  const AngleSensitivity angles = angle_sensitivity(calibration, description, axis, column);
  const Gravity& gravity = description.gravity;
  const double by_gravity = column == 3 ? 0 : budget.value / gravity.local_mps2;
  const auto line = [](BudgetSource source, double value, double u, double sensitivity) {
    return BudgetLine{source, value, u, kInfinite, sensitivity, std::abs(sensitivity) * u, 0};
  };
  budget.lines = {line(BudgetSource::delta, 0, description.angles.delta_arcsec, angles.delta),
                  line(BudgetSource::h, 0, description.angles.h_arcsec, angles.h),
                  line(BudgetSource::gravity, gravity.local_mps2, gravity.u_mps2, by_gravity)};
  if (calibration.uncertainty) {
    const auto& parameter = calibration.uncertainty->parameter[axis];
    const double u = parameter[static_cast<std::size_t>(column)].budget.alternatives;
    constexpr double kFeltShare = 5e-4;
    if (u * u > kFeltShare * variance)
      budget.lines.push_back(line(BudgetSource::alternatives, 0, u, 1));
  }
  double rest = variance;
  for (const BudgetLine& l : budget.lines) rest -= l.contribution * l.contribution;
  BudgetLine readings =
      line(BudgetSource::readings, budget.value, std::sqrt(std::max(0.0, rest)), 1);
  readings.dof = static_cast<double>(calibration.poses) - 4;
  budget.lines.insert(budget.lines.begin(), readings);
  for (BudgetLine& l : budget.lines) {
    l.share = variance > 0 ? std::min(1.0, l.contribution * l.contribution / variance) : 0;
  }
  const double share = budget.lines.front().share;
  budget.dof_effective = share > 0 && readings.dof > 0 ? readings.dof / (share * share) : kInfinite;
  return budget;
}

}  // namespace plumbline::app
