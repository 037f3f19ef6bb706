// Geometry of the head: from commanded angles and the errors of a real head to the direction of
// gravity in the sensor frame. Worked with rotation matrices, independent of any estimator.
#pragma once

#include <array>

namespace plumbline::sim {

/// How a real head differs from the ideal one. All zero is the ideal head.
///
/// Frames: base b with z_b up, x_b along the spindle at h = 0; sensor s with z_s along the spindle
/// and x_s up, y_s = −y_b at δ = h = 0. δ turns right-handed about z_s, h raises the spindle.
struct HeadErrors {
  double base_roll_deg = 0;  ///< base turned right-handed about x_b
  double base_pitch_deg =
      0;  ///< base turned about −y_b: raises the spindle as a tilt index error does
  double axis_skew_deg = 0;    ///< spindle turned out of the perpendicular to the tilt axis,
                               ///< right-handed about the upright axis that tilts with h
  double delta_index_deg = 0;  ///< constant error of δ
  double delta_eccentricity_c_deg = 0;  ///< δ += c·cos δ + s·sin δ
  double delta_eccentricity_s_deg = 0;
  double delta_ellipticity_c_deg = 0;  ///< δ += c·cos 2δ + s·sin 2δ
  double delta_ellipticity_s_deg = 0;
  double h_index_deg = 0;           ///< constant error of h
  double h_scale = 0;               ///< h = h·(1 + k)
  double h_eccentricity_c_deg = 0;  ///< h += c·cos h + s·sin h
  double h_eccentricity_s_deg = 0;
  double backlash_deg = 0;  ///< δ += ±w/2 by the direction in which δ was last approached
};

/// Directions seen in the sensor frame (components x_s, y_s, z_s); all of unit length.
struct Attitude {
  std::array<double, 3> up;      ///< against gravity
  std::array<double, 3> base_x;  ///< x_b
  std::array<double, 3> base_y;  ///< y_b
};

/// Attitude of the sensor at the given angles. `approach` is +1 or −1, the direction of the last δ
/// motion, 0 when δ has not moved yet. All errors are functions of the angles passed in, and add.
Attitude attitude(const HeadErrors& errors, double delta_deg, double h_deg, int approach = 0);

}  // namespace plumbline::sim
