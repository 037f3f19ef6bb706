#include "estimator/kinematics.h"

#include <cmath>
#include <numbers>

namespace plumbline {

SpecificForce specific_force(double delta_deg, double h_deg, double gamma) {
  constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;
  const double sin_delta = std::sin(delta_deg * kRadiansPerDegree);
  const double cos_delta = std::cos(delta_deg * kRadiansPerDegree);
  const double sin_h = std::sin(h_deg * kRadiansPerDegree);
  const double cos_h = std::cos(h_deg * kRadiansPerDegree);
  SpecificForce force;
  force.a_g = gamma * Eigen::Vector3d(cos_h * cos_delta, -cos_h * sin_delta, sin_h);
  force.d_delta_g_per_rad = gamma * Eigen::Vector3d(-cos_h * sin_delta, -cos_h * cos_delta, 0.0);
  force.d_h_g_per_rad = gamma * Eigen::Vector3d(-sin_h * cos_delta, sin_h * sin_delta, cos_h);
  return force;
}

}  // namespace plumbline
