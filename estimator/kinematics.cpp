#include "estimator/kinematics.h"

#include <Eigen/Geometry>
#include <cmath>

#include "estimator/angle_units.h"

namespace plumbline {

Eigen::Vector3d specific_force_g(const HeadGeometry& head, double gamma) {
  const double ch = std::cos(head.h_rad), sh = std::sin(head.h_rad);
  const double cd = std::cos(head.delta_rad), sd = std::sin(head.delta_rad);
  const double ce = std::cos(head.roll_rad), se = std::sin(head.roll_rad);
  const double cn = std::cos(head.skew_rad), sn = std::sin(head.skew_rad);
  // The plumb line along the triad's axes at δ = 0: x and y in the plane of the turntable, z along
  // the spindle.
  const double up_x = ch * ce;
  const double up_y = sn * sh * ce - cn * se;
  const double up_z = cn * sh * ce + sn * se;
  const Eigen::Vector3d on_table(up_x * cd + up_y * sd, -up_x * sd + up_y * cd, up_z);
  const double lifted = gamma * (1 + head.lift);
  if (head.seat_x_rad == 0 && head.seat_y_rad == 0) return lifted * on_table;
  const auto turned = Eigen::AngleAxisd(head.seat_y_rad, Eigen::Vector3d::UnitY()) *
                      Eigen::AngleAxisd(head.seat_x_rad, Eigen::Vector3d::UnitX());
  return lifted * (turned.inverse() * on_table);
}

Eigen::Vector3d slope_g_per_rad(const HeadGeometry& head, double HeadGeometry::*angle,
                                double gamma) {
  constexpr double kStep_rad = 1e-5;
  HeadGeometry above = head, below = head;
  above.*angle += kStep_rad;
  below.*angle -= kStep_rad;
  return (specific_force_g(above, gamma) - specific_force_g(below, gamma)) / (2 * kStep_rad);
}

HorizontalAxes horizontal_axes(double delta_rad, double h_rad) {
  const double sh = std::sin(h_rad), ch = std::cos(h_rad);
  const double sd = std::sin(delta_rad), cd = std::cos(delta_rad);
  return {{-sh * cd, sh * sd, ch}, {-sd, -cd, 0}};
}

SpecificForce specific_force(double delta_deg, double h_deg, double gamma) {
  const double sin_delta = std::sin(delta_deg * kRadPerDeg);
  const double cos_delta = std::cos(delta_deg * kRadPerDeg);
  const double sin_h = std::sin(h_deg * kRadPerDeg);
  const double cos_h = std::cos(h_deg * kRadPerDeg);
  SpecificForce force;
  force.a_g = specific_force_g({delta_deg * kRadPerDeg, h_deg * kRadPerDeg}, gamma);
  force.d_delta_g_per_rad = gamma * Eigen::Vector3d(-cos_h * sin_delta, -cos_h * cos_delta, 0.0);
  force.d_h_g_per_rad = gamma * Eigen::Vector3d(-sin_h * cos_delta, sin_h * sin_delta, cos_h);
  return force;
}

}  // namespace plumbline
