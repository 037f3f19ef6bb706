#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/restored_model.h"
#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/outlying_readings.h"
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
  std::vector<std::string> left_out, lacking, decided_otherwise;
};

/// Sum over the axes.
double square_mps2(const EvaluationFigures& figures) {
  double sum = 0;
  for (const double rms : figures.pose_rms_mps2) sum += rms * rms;
  return sum;
}

Applied apply(const CertifiedModel& model, const MeasurementSet& set, VisitLog log,
              const std::vector<PoseMean>& poses, BetweenSets head) {
  put_in_front(model.history, head, log);
  RestoredModel restored = restore_model(model, log);
  const auto with = [&](const EnlargedParameters& parameters) {
    PerAxis<Eigen::VectorXd> predicted_V = predict_means_V(log, parameters);
    for (Eigen::VectorXd& axis : predicted_V) axis = axis.tail(std::ssize(poses)).eval();
    return figures(model.final, predicted_V, set, poses);
  };
  Applied best{
      with(restored.parameters), std::move(restored.left_out), std::move(restored.lacking), {}};
  if (log.goes_as_commanded) return best;  // nothing of a rig of our own is open
  for (ActiveEffect& active : restored.parameters.effects) {
    for (const auto& other : active.effect->left_open_by(model.history, active.p)) {
      const std::vector<double> found = std::exchange(active.p, other);
      const EvaluationFigures otherwise = with(restored.parameters);
      if (square_mps2(otherwise) < square_mps2(best.figures)) {
        best.figures = otherwise;
        if (best.decided_otherwise.empty() || best.decided_otherwise.back() != active.effect->id())
          best.decided_otherwise.push_back(active.effect->id());
      } else {
        active.p = found;
      }
    }
  }
  return best;
}

}  // namespace

CertifiedModel certified_model(const Calibration& calibration,
                               const std::vector<std::shared_ptr<const Effect>>& own_effects) {
  return {.twelve = calibration.estimates.batch_ls,
          .final = calibration.final.batch_ls,
          .effects = calibration.diagnosis.effects,
          .unlisted = calibration.diagnosis.unlisted,
          .history = calibration.diagnosis.history,
          .ranges = calibration.ranges,
          .own_effects = own_effects};
}

Evaluation evaluate(const CertifiedModel& model, const MeasurementSet& given,
                    const RunDescription& description, std::optional<BetweenSets> head) {
  Evaluation result;
  MeasurementSet set = given;
  result.outlying_readings = replace_outlying(set, description.adc);
  const std::vector<PoseMean> poses = pose_means(set);
  result.poses = poses.size();
  result.samples = set.samples.size();
  result.beyond = beyond(model.ranges, set.samples);
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
    for (const BetweenSets from : {BetweenSets::nowhere, BetweenSets::home}) {
      Applied from_there = apply(model, set, log, poses, from);
      if (square_mps2(from_there.figures) < square_mps2(applied.figures)) {
        applied = std::move(from_there);
        result.head = from;
      }
    }
  }
  result.after = applied.figures;
  result.left_out = std::move(applied.left_out);
  result.lacking = std::move(applied.lacking);
  result.decided_otherwise = std::move(applied.decided_otherwise);
  return result;
}

std::size_t axis_standing_out(const PerAxis<double>& error, const PerAxis<double>& expected) {
  const auto ratio = [&](std::size_t axis) {
    return error[axis] / std::max(1e-300, expected[axis]);
  };
  std::size_t worst = 0;
  for (std::size_t axis = 1; axis < kAxisCount; ++axis)
    if (ratio(axis) > ratio(worst)) worst = axis;
  return worst;
}

std::optional<std::size_t> contradicted_axis(const Calibration& calibration,
                                             const Evaluation& verification) {
  constexpr double kByChance = 1e-3;
  const auto poses = static_cast<double>(verification.poses);
  PerAxis<double> allowed_mps2;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    allowed_mps2[i] =
        std::sqrt(chi_squared_quantile(1 - kByChance, poses) / poses) *
        (calibration.floor_pose_rms_mps2[i] + 2 * calibration.u_floor_pose_rms_mps2[i]);
  const PerAxis<double>& error_mps2 = verification.after.pose_rms_mps2;
  const std::size_t worst = axis_standing_out(error_mps2, allowed_mps2);
  if (error_mps2[worst] <= allowed_mps2[worst]) return {};
  return worst;
}

}  // namespace plumbline
