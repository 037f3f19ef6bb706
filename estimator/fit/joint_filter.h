// The extended Kalman filter proper: all three axes and the errors of the head that they share in
// one state.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/measurement.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// Places of the states: 4·axis + (K_ix K_iy K_iz U_i0), the errors of the head, then for each axis
/// flicker and random walk.
enum JointState : Eigen::Index {
  kJointRoll = 12,  ///< base about x_b, rad
  kJointTiltIndex,  ///< added to h, rad
  kJointSkew,       ///< of the spindle against the normal of the tilt axis, rad
  kJointDrift,      ///< + 2·axis + (flicker, random walk), V
  kJointStateCount = kJointDrift + 6
};
/// Parameters of the unit and of the head, without the drifts.
inline constexpr Eigen::Index kJointParameterCount = kJointDrift;

/// One visit as the filter sees it.
struct JointVisit {
  double t_s = 0;
  double delta_deg = 0;
  double h_deg = 0;
  PerAxis<double> mean_V{};
  PerAxis<double> variance_V2{};  ///< of the mean's uncorrelated error
};

struct JointFilterOptions {
  double parameter_sd = 1e1;  ///< prior, V/g and V: leaves no trace
  /// Prior of roll, tilt index and skew; 0: the head does not have this error.
  std::array<double, 3> head_sd_rad = {0.05, 0.05, 0.05};
  double flicker_correlation_s = 100.0;  ///< as EightStateOptions
  int most_passes = 8;
};

struct JointEstimate {
  Eigen::Matrix<double, kJointParameterCount, 1> value;
  Eigen::Matrix<double, kJointParameterCount, kJointParameterCount> covariance;
  double mean_nis = 0;     ///< over all readings but those that the prior still dominates
  bool converged = false;  ///< the last pass moved nothing by more than a thousandth of its u
};

/// Extended Kalman filter over the visits in order of time, Joseph form. The outputs are products
/// of sensitivities and sines of the head's errors: linearised about an early estimate, early
/// readings would be judged wrongly for good. The run is therefore passed again, linearised about
/// what the last pass ended with, until nothing moves: the filter's form of Gauss and Newton's
/// method (Bell & Cathey 1993), with the optimum of nonlinear least squares. `gamma`: local over
/// standard gravity. Preconditions: at least one visit; times do not decrease.
JointEstimate run_joint_filter(const std::vector<JointVisit>& visits, double gamma,
                               const PerAxis<NoiseModel>& noise, const JointFilterOptions& options);

}  // namespace plumbline
