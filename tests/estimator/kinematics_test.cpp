#include "estimator/kinematics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace plumbline {
namespace {

void expect_vector(const Eigen::Vector3d& actual, double x, double y, double z) {
  EXPECT_NEAR(actual.x(), x, 1e-15);
  EXPECT_NEAR(actual.y(), y, 1e-15);
  EXPECT_NEAR(actual.z(), z, 1e-15);
}

// Worked out by hand on a sketch of the head: x_s up at zero; a quarter turn right-handed about z_s
// brings −y_s up; raising the spindle to the vertical leaves all of g on z_s.
TEST(Kinematics, KnownPositions) {
  expect_vector(specific_force(0, 0, 1).a_g, 1, 0, 0);
  expect_vector(specific_force(90, 0, 1).a_g, 0, -1, 0);
  expect_vector(specific_force(180, 0, 1).a_g, -1, 0, 0);
  expect_vector(specific_force(270, 0, 1).a_g, 0, 1, 0);
  expect_vector(specific_force(123, 90, 1).a_g, 0, 0, 1);
  const double half = 0.5;
  const double root3 = std::sqrt(3.0);
  expect_vector(specific_force(30, 60, 2.0).a_g, half * root3, -half, root3);
}

TEST(Kinematics, DerivativesAgreeWithDifferences) {
  constexpr double kStep_deg = 1e-3;
  constexpr double kStep_rad = kStep_deg * 3.14159265358979323846 / 180;
  for (const double delta_deg : {0.0, 37.0, 210.0}) {
    for (const double h_deg : {0.0, 25.0, 80.0}) {
      const SpecificForce force = specific_force(delta_deg, h_deg, 1.0003);
      const Eigen::Vector3d d_delta = (specific_force(delta_deg + kStep_deg, h_deg, 1.0003).a_g -
                                       specific_force(delta_deg - kStep_deg, h_deg, 1.0003).a_g) /
                                      (2 * kStep_rad);
      const Eigen::Vector3d d_h = (specific_force(delta_deg, h_deg + kStep_deg, 1.0003).a_g -
                                   specific_force(delta_deg, h_deg - kStep_deg, 1.0003).a_g) /
                                  (2 * kStep_rad);
      EXPECT_LT((force.d_delta_g_per_rad - d_delta).norm(), 1e-9);
      EXPECT_LT((force.d_h_g_per_rad - d_h).norm(), 1e-9);
      EXPECT_NEAR(force.a_g.norm(), 1.0003, 1e-15);
    }
  }
}

// A triad that turns right-handed about one of its axes sees the plumb line turn left-handed.
TEST(Kinematics, ATriadMayTiltInItsSeat) {
  const double quarter = std::acos(0.0);
  HeadGeometry about_x, about_y, about_both;
  about_x.seat_x_rad = about_y.seat_y_rad = quarter;
  about_both.seat_x_rad = about_both.seat_y_rad = quarter;
  about_x.h_rad = quarter;  // z_s up
  expect_vector(specific_force_g(about_x, 1), 0, 1, 0);
  expect_vector(specific_force_g(about_y, 1), 0, 0, 1);     // x_s up before
  expect_vector(specific_force_g(about_both, 1), 0, 1, 0);  // about y brings z_s up, about x y_s
}

}  // namespace
}  // namespace plumbline
