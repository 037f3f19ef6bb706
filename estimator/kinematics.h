// What the head does to the triad: angles of the dividing head to specific force in the sensor
// frame.
#pragma once

#include <Eigen/Core>
#include <array>

namespace plumbline {

/// Head and base with their errors at one visit.
struct HeadGeometry {
  double delta_rad = 0;
  double h_rad = 0;
  double roll_rad = 0;    ///< of the base about x_b
  double skew_rad = 0;    ///< of the spindle against the normal of the tilt axis
  double seat_x_rad = 0;  ///< of the triad on the turntable about its own x, after that about y
  double seat_y_rad = 0;
  double lift = 0;  ///< what accelerates the base upwards, as a share of gravity

  bool operator==(const HeadGeometry&) const = default;
};

/// All of them, the lift last.
inline constexpr std::array kHeadAngles = {&HeadGeometry::delta_rad,  &HeadGeometry::h_rad,
                                           &HeadGeometry::roll_rad,   &HeadGeometry::skew_rad,
                                           &HeadGeometry::seat_x_rad, &HeadGeometry::seat_y_rad,
                                           &HeadGeometry::lift};

/// Specific force in the sensor frame, standard g. With δ and h alone this is
/// γ·(cos h cos δ, −cos h sin δ, sin h). A lift makes γ larger by that share.
Eigen::Vector3d specific_force_g(const HeadGeometry& head, double gamma);

/// ∂a/∂angle of one of the angles, g/rad, or of the lift, g, by a central difference.
Eigen::Vector3d slope_g_per_rad(const HeadGeometry& head, double HeadGeometry::*angle,
                                double gamma);

/// The horizontal axes of the base, unit vectors, as an ideal head shows them to the triad.
struct HorizontalAxes {
  Eigen::Vector3d x_b, y_b;
};
HorizontalAxes horizontal_axes(double delta_rad, double h_rad);

/// Specific force at rest in the sensor frame, in standard g, and how it changes with the angles.
struct SpecificForce {
  Eigen::Vector3d a_g;
  Eigen::Vector3d d_delta_g_per_rad;  ///< ∂a/∂δ
  Eigen::Vector3d d_h_g_per_rad;      ///< ∂a/∂h
};

/// a(δ, h) = γ·(cos h cos δ, −cos h sin δ, sin h): the plumb line seen by a triad whose z axis lies
/// along the spindle, x up at δ = h = 0 (Kostyuk & Lakoza 2012, experiment). `gamma` is local
/// gravity over standard gravity. Degrees become radians here and nowhere else.
SpecificForce specific_force(double delta_deg, double h_deg, double gamma);

}  // namespace plumbline
