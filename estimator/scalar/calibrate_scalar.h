// Calibration without angles: rests in, nine parameters, diagnosis and errors out.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/scalar/scalar_model.h"

namespace plumbline {

/// Nine parameters with their covariance, order of ScalarVector.
struct ScalarEstimate {
  ScalarVector value = ScalarVector::Zero();
  Eigen::Matrix<double, kScalarCount, kScalarCount> covariance =
      Eigen::Matrix<double, kScalarCount, kScalarCount>::Zero();

  double u(Eigen::Index index) const { return std::sqrt(covariance(index, index)); }
};

/// One rest, for pictures and tables.
struct RestResult {
  Pose pose;
  double t_mean_s = 0;
  Eigen::Vector3d reading = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit vector of the specific force
  double residual_before_mps2 = 0;                      ///< |a| − g
  double residual_after_mps2 = 0;
  double expected_mps2 = 0;  ///< standard deviation that the scatter inside leaves
};

/// How the angle-free result compares with a head that was there after all.
struct HeadComparison {
  /// Head minus scalar, from the 12-parameter model brought into the same gauge.
  ScalarVector difference = ScalarVector::Zero();
  ScalarVector u_difference = ScalarVector::Zero();
  double largest_en = 0;  ///< over the nine
  /// Angle between the commanded direction of gravity and the calibrated one after the best
  /// rotation of the triad as a whole (mounting), RMS and largest, and what noise and positioning
  /// would leave.
  double direction_rms_deg = 0;
  double direction_max_deg = 0;
  double expected_direction_rms_deg = 0;
  double mounting_deg = 0;  ///< angle of that rotation
  std::string words;        ///< one sentence
};

struct ScalarCalibration {
  std::size_t intervals = 0;
  std::size_t samples = 0;  ///< within the rests
  std::size_t skipped_rows = 0;
  double condition = 0;
  ScalarEstimate estimate;       ///< the nine parameters alone
  ScalarEstimate final;          ///< together with the effects
  double residual_rms_mps2 = 0;  ///< √(Σ(|a| − g)²/(n − 9)), the nine parameters alone
  double final_residual_rms_mps2 = 0;
  double expected_rms_mps2 = 0;  ///< what the scatter inside the rests would leave, s/√n
  /// The same with what neighbouring readings have in common, from block means.
  double expected_rms_blocks_mps2 = 0;
  double scatter_mps2 = 0;  ///< from rest to rest, beyond the scatter inside and slow noise
  PerAxis<NoiseModel> noise;
  Diagnosis diagnosis;
  /// Per axis: the residual |a| − g weighted with the axis's share of gravity squared.
  ErrorFigures before;
  ErrorFigures after;
  PerAxis<double> floor_pose_rms_mps2{};
  PerAxis<double> u_floor_pose_rms_mps2{};
  Decision decision;
  std::vector<RestResult> rests;
  std::optional<HeadComparison> head;
};

struct ScalarInput {
  const MeasurementSet& set;  ///< poses are the rests; angles may be absent
  const RunDescription& description;
};

/// Fails (input) when the rests do not determine the nine parameters, with the reason: fewer than
/// nine, all in one attitude, an axis that does not follow.
Result<ScalarCalibration> calibrate_scalar(const ScalarInput& input,
                                           const CalibrationOptions& options);

/// Cosines of the angles between the sensitive axes x–y, x–z, y–z: what of T is measured.
Eigen::Vector3d axis_cosines(const ScalarVector& nine);

}  // namespace plumbline
