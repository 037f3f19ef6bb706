// The extended Kalman filter proper: all three axes, the errors of the head that they share and
// whatever else the model has for parameters in one state.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "estimator/measurement.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// What n visits have measured. Means carry the slow drifts of their axis; contrasts within the
/// dwell do not.
struct JointReadings {
  std::vector<double> t_s;               ///< n, not decreasing
  PerAxis<Eigen::VectorXd> mean_V;       ///< n
  PerAxis<Eigen::VectorXd> variance_V2;  ///< n, of the mean's uncorrelated error
  PerAxis<Eigen::MatrixXd> dwell_V;      ///< n × c, c ≥ 0 alike for all axes
  PerAxis<Eigen::VectorXd> dwell_sd_V;   ///< c
};

/// Prediction of all readings at given parameters, and its derivatives. Rows: the means of x, then
/// y, then z (n each), then the contrasts, n rows for each contrast of each axis.
struct JointPrediction {
  Eigen::VectorXd value_V;
  Eigen::MatrixXd slope;  ///< rows × parameters
};
using JointModel = std::function<JointPrediction(const Eigen::VectorXd& parameters)>;

struct JointFilterOptions {
  double flicker_correlation_s = 100.0;  ///< as EightStateOptions
  int most_passes = 8;
};

struct JointEstimate {
  Eigen::VectorXd value;       ///< of the parameters
  Eigen::MatrixXd covariance;  ///< of the parameters
  double mean_nis = 0;         ///< over all means but those that the prior still dominates
  bool converged = false;      ///< the last pass moved nothing by more than a thousandth of its u
};

/// Extended Kalman filter over the visits in order of time, Joseph form. State: the parameters,
/// constant, with priors too wide to leave a trace, then flicker and random walk of each axis. The
/// readings depend on products and sines of the parameters: linearised about an early estimate,
/// early readings would be judged wrongly for good. The run is therefore passed again, linearised
/// about what the last pass ended with, until nothing moves: the filter's form of Gauss and
/// Newton's method (Bell & Cathey 1993), with the optimum of nonlinear least squares. `start` is
/// where the first pass is linearised. Preconditions: at least one visit; every parameter moves
/// some reading.
JointEstimate run_joint_filter(const JointReadings& readings, const JointModel& model,
                               const Eigen::VectorXd& start, const PerAxis<NoiseModel>& noise,
                               const JointFilterOptions& options);

}  // namespace plumbline
