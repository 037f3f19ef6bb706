#include <Eigen/Core>
#include <cmath>

#include "estimator/calibrate.h"
#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/pose_means.h"

namespace plumbline {
namespace {

EvaluationFigures figures(const TriadEstimate& model, const MeasurementSet& set,
                          const std::vector<PoseMean>& poses, const Gravity& gravity) {
  const Eigen::MatrixXd A = design_matrix(poses, gravity);
  EvaluationFigures result;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const double factor = input_referred_mps2_per_V(model[axis], axis);
    const Eigen::VectorXd error = factor * (mean_voltages(poses, axis) - A * model[axis].value);
    result.pose_rms_mps2[axis] = rms(error);
    result.pose_max_abs_mps2[axis] = max_abs(error);
    result.sample_rms_mps2[axis] = std::abs(factor) * sample_rms_V(set, gravity, model[axis], axis);
  }
  return result;
}

}  // namespace

Evaluation evaluate(const CertifiedModel& model, const MeasurementSet& set,
                    const RunDescription& description) {
  const std::vector<PoseMean> poses = pose_means(set);
  Evaluation result;
  result.poses = poses.size();
  result.samples = set.samples.size();
  result.before = figures(model.twelve, set, poses, description.gravity);
  result.after = figures(model.final, set, poses, description.gravity);
  return result;
}

}  // namespace plumbline
