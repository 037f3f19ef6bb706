#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/explain.h"
#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/pose_means.h"

namespace plumbline {
namespace {

/// Errors of predicted pose means, V, one vector of n poses per axis.
EvaluationFigures figures(const TriadEstimate& model, const PerAxis<Eigen::VectorXd>& predicted_V,
                          const MeasurementSet& set, const std::vector<PoseMean>& poses) {
  EvaluationFigures result;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const double factor = input_referred_mps2_per_V(model[axis], axis);
    const Eigen::VectorXd error = factor * (mean_voltages(poses, axis) - predicted_V[axis]);
    result.pose_rms_mps2[axis] = rms(error);
    result.pose_max_abs_mps2[axis] = max_abs(error);
    result.sample_rms_mps2[axis] = std::abs(factor) * sample_rms_V(set, predicted_V[axis], axis);
  }
  return result;
}

/// The certified model on another set.
struct Applied {
  EvaluationFigures figures;
  std::vector<std::string> left_out;

  double square_mps2() const {
    double sum = 0;
    for (const double rms : figures.pose_rms_mps2) sum += rms * rms;
    return sum;
  }
};

Applied apply(const CertifiedModel& model, const MeasurementSet& set, VisitLog log,
              const std::vector<PoseMean>& poses, BetweenSets head) {
  put_in_front(model.history, head, log);
  RestoredModel restored = restore_model(model, log);
  PerAxis<Eigen::VectorXd> predicted_V = predict_means_V(log, restored.parameters);
  for (Eigen::VectorXd& axis : predicted_V) axis = axis.tail(std::ssize(poses)).eval();
  return {figures(model.final, predicted_V, set, poses), std::move(restored.left_out)};
}

}  // namespace

CertifiedModel certified_model(const Calibration& calibration,
                               const std::vector<std::shared_ptr<const Effect>>& own_effects) {
  return {.twelve = calibration.estimates.batch_ls,
          .final = calibration.final.batch_ls,
          .effects = calibration.diagnosis.effects,
          .unlisted = calibration.diagnosis.unlisted,
          .history = calibration.diagnosis.history,
          .own_effects = own_effects};
}

Evaluation evaluate(const CertifiedModel& model, const MeasurementSet& set,
                    const RunDescription& description, std::optional<BetweenSets> head) {
  const std::vector<PoseMean> poses = pose_means(set);
  Evaluation result;
  result.poses = poses.size();
  result.samples = set.samples.size();
  const Eigen::MatrixXd A = design_matrix(poses, description.gravity);
  PerAxis<Eigen::VectorXd> twelve_V;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    twelve_V[axis] = A * model.twelve[axis].value;
  }
  result.before = figures(model.twelve, twelve_V, set, poses);

  // Nothing recorded says whether the head went elsewhere in between, but the first poses show it.
  const VisitLog log = make_visit_log(set, description);
  result.head = head.value_or(BetweenSets::anywhere);
  Applied applied = apply(model, set, log, poses, result.head);
  if (!head && !model.history.visits.empty()) {
    Applied from_there = apply(model, set, log, poses, BetweenSets::nowhere);
    if (from_there.square_mps2() < applied.square_mps2()) {
      applied = std::move(from_there);
      result.head = BetweenSets::nowhere;
    }
  }
  result.after = applied.figures;
  result.left_out = std::move(applied.left_out);
  return result;
}

}  // namespace plumbline
