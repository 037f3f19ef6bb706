#include "rig/sim/head_errors.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace plumbline::sim {

namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

double harmonic(double c, double s, double angle_deg) {
  return c * std::cos(angle_deg * kRadPerDeg) + s * std::sin(angle_deg * kRadPerDeg);
}

Matrix3d turn(double angle_deg, const Vector3d& about) {
  return AngleAxisd(angle_deg * kRadPerDeg, about).toRotationMatrix();
}

}  // namespace

Attitude attitude(const HeadErrors& e, double delta_deg, double h_deg, int approach) {
  const double delta =
      delta_deg + e.delta_index_deg +
      harmonic(e.delta_eccentricity_c_deg, e.delta_eccentricity_s_deg, delta_deg) +
      harmonic(e.delta_ellipticity_c_deg, e.delta_ellipticity_s_deg, 2 * delta_deg) +
      0.5 * approach * e.backlash_deg;
  const double h = h_deg * (1 + e.h_scale) + e.h_index_deg +
                   harmonic(e.h_eccentricity_c_deg, e.h_eccentricity_s_deg, h_deg);

  // The moving parts, as columns in base coordinates. The sensor starts at δ = h = 0 with x_s up,
  // y_s = −y_b and z_s along the spindle; it turns about the spindle, the spindle leans by the
  // skew, the tilt axis −y_b raises all of it.
  Matrix3d sensor;
  sensor.col(0) = Vector3d::UnitZ();
  sensor.col(1) = -Vector3d::UnitY();
  sensor.col(2) = Vector3d::UnitX();
  const Matrix3d sensor_in_base = turn(h, -Vector3d::UnitY()) *
                                  turn(e.axis_skew_deg, Vector3d::UnitZ()) *
                                  turn(delta, Vector3d::UnitX()) * sensor;
  // The base in level coordinates: pitch about −y of the level frame, then roll about its own x_b.
  const Matrix3d base =
      turn(e.base_pitch_deg, -Vector3d::UnitY()) * turn(e.base_roll_deg, Vector3d::UnitX());

  const Vector3d up = sensor_in_base.transpose() * (base.transpose() * Vector3d::UnitZ());
  const Vector3d x = sensor_in_base.transpose() * Vector3d::UnitX();
  const Vector3d y = sensor_in_base.transpose() * Vector3d::UnitY();
  const auto components = [](const Vector3d& v) { return std::array{v.x(), v.y(), v.z()}; };
  return {components(up), components(x), components(y)};
}

}  // namespace plumbline::sim
