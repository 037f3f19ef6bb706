// The naive search that stands beside ours in the study: see search_naively().
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/diagnosis/candidate_responses.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/pose_means.h"
#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

constexpr std::size_t kMostEffects = 10;
constexpr double kAbsorbed = 1e-6;  ///< share of a column below which nothing of it is left

/// A linear model of the pose means of all three axes, rows x, then y, then z of one session; it is
/// fitted to the poses of the run alone.
class LinearModel {
 public:
  LinearModel(const StudySet& set, const std::vector<PoseMean>& poses)
      : N_(std::ssize(poses)), n_(std::ssize(set.set.run.poses)) {
    const Eigen::MatrixXd A = design_matrix(poses, set.set.description.gravity);
    columns_ = Eigen::MatrixXd::Zero(3 * N_, 12);
    y_V_.resize(3 * N_);
    for (Eigen::Index i = 0; i < 3; ++i) {
      columns_.block(i * N_, 4 * i, N_, 4) = A;
      y_V_.segment(i * N_, N_) = mean_voltages(poses, static_cast<std::size_t>(i));
    }
    fit();
  }

  void add(const Eigen::MatrixXd& columns) {
    columns_.conservativeResize(Eigen::NoChange, columns_.cols() + columns.cols());
    columns_.rightCols(columns.cols()) = columns;
    fit();
  }
  /// The n rows of the run of one axis, divided by the noise of that axis.
  Eigen::MatrixXd scaled(const Eigen::MatrixXd& rows, std::size_t axis) const {
    return rows.topRows(n_) / sd_V_[axis];
  }
  auto basis(std::size_t axis) const {
    return basis_.middleRows(static_cast<Eigen::Index>(axis) * n_, n_);
  }
  auto residual(std::size_t axis) const {
    return residual_.segment(static_cast<Eigen::Index>(axis) * n_, n_);
  }
  Eigen::Index columns() const { return columns_.cols(); }
  Eigen::Index poses() const { return N_; }
  Eigen::Index fitted_poses() const { return n_; }
  Eigen::Vector4d twelve(std::size_t axis) const {
    return coefficient_.segment<4>(4 * static_cast<Eigen::Index>(axis));
  }
  Eigen::VectorXd error_V(std::size_t axis) const {
    const auto first = static_cast<Eigen::Index>(axis) * N_;
    return y_V_.segment(first, N_) - columns_.middleRows(first, N_) * coefficient_;
  }

 private:
  /// Weighted least squares; the weights are those of the fit before, twice.
  void fit() {
    for (int pass = 0; pass < 2; ++pass) {
      Eigen::MatrixXd A(3 * n_, columns_.cols());
      Eigen::VectorXd y(3 * n_);
      for (std::size_t i = 0; i < kAxisCount; ++i) {
        const auto axis = static_cast<Eigen::Index>(i);
        A.middleRows(axis * n_, n_) = scaled(columns_.middleRows(axis * N_, N_), i);
        y.segment(axis * n_, n_) = y_V_.segment(axis * N_, n_) / sd_V_[i];
      }
      const Eigen::VectorXd norm = A.colwise().norm();
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(A * norm.cwiseInverse().asDiagonal());
      coefficient_ = norm.cwiseInverse().cwiseProduct(qr.solve(y));
      basis_ = qr.householderQ() * Eigen::MatrixXd::Identity(A.rows(), A.cols());
      residual_ = y - A * coefficient_;
      for (std::size_t i = 0; i < kAxisCount; ++i) {
        const double scale = std::sqrt(residual(i).squaredNorm() / static_cast<double>(n_));
        sd_V_[i] *= scale;
        residual_.segment(static_cast<Eigen::Index>(i) * n_, n_) /= scale;
      }
    }
  }

  Eigen::Index N_;           ///< poses of the session
  Eigen::Index n_;           ///< of the run: the first ones
  Eigen::MatrixXd columns_;  ///< 3N × p, V per unit
  Eigen::VectorXd y_V_;      ///< 3N
  PerAxis<double> sd_V_{1, 1, 1};
  Eigen::VectorXd coefficient_;  ///< p
  Eigen::MatrixXd basis_;        ///< 3n × p, orthonormal
  Eigen::VectorXd residual_;     ///< 3n, of unit mean square on each axis
};

/// Columns of one candidate over the session, V per unit: one block of N rows for each axis that it
/// touches.
struct Columns {
  std::vector<std::size_t> axes;
  Eigen::MatrixXd rows;
};

Columns columns_of(const CandidateResponses& responses, std::size_t candidate, std::size_t axis) {
  const auto& [group, first, count] = responses.place[candidate];
  const Eigen::MatrixXd& all = responses.groups[group].means;
  Columns result{{axis}, all.middleCols(first, count)};
  if (group + 1 == responses.groups.size()) result.axes = {0, 1, 2};
  return result;
}

struct Step {
  double change = 0;           ///< of the BIC
  Eigen::MatrixXd directions;  ///< of the candidate's columns, those that are not absorbed
};

/// What adding a candidate does to the BIC.
Step try_candidate(const LinearModel& model, const Columns& columns, bool one_of_many) {
  const Eigen::Index n = model.fitted_poses();
  const Eigen::Index k = columns.rows.cols();
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(k, k);
  Eigen::MatrixXd taken = Eigen::MatrixXd::Zero(model.columns(), k);
  Eigen::VectorXd along = Eigen::VectorXd::Zero(k);
  std::vector<Eigen::MatrixXd> scaled;
  for (std::size_t b = 0; b < columns.axes.size(); ++b) {
    const std::size_t axis = columns.axes[b];
    scaled.push_back(model.scaled(
        columns.rows.middleRows(static_cast<Eigen::Index>(b) * model.poses(), model.poses()),
        axis));
    const Eigen::MatrixXd& C = scaled.back();
    whole += C.transpose() * C;
    taken += model.basis(axis).transpose() * C;
    along += C.transpose() * model.residual(axis);
  }
  const Eigen::VectorXd norm = whole.diagonal().cwiseSqrt();
  if (!(norm.minCoeff() > 0)) return {};
  const Eigen::VectorXd unit = norm.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> left(
      unit.asDiagonal() * (whole - taken.transpose() * taken) * unit.asDiagonal());
  const Eigen::Index lost = (left.eigenvalues().array() < kAbsorbed).count();
  const Eigen::Index free = k - lost;
  if (free == 0) return {};
  Step step;
  step.directions = unit.asDiagonal() * left.eigenvectors().rightCols(free);
  const Eigen::VectorXd size = left.eigenvalues().tail(free).cwiseInverse().cwiseProduct(
      step.directions.transpose() * along);
  const Eigen::VectorXd coefficient = step.directions * size;
  const double parameters = static_cast<double>(free) + (one_of_many ? 1 : 0);
  step.change = parameters * std::log(3.0 * static_cast<double>(n));
  for (std::size_t b = 0; b < columns.axes.size(); ++b) {
    const Eigen::VectorXd fitted =
        scaled[b] * coefficient - model.basis(columns.axes[b]) * (taken * coefficient);
    const double rest =
        (model.residual(columns.axes[b]) - fitted).squaredNorm() / static_cast<double>(n);
    step.change += static_cast<double>(n) * std::log(rest);
  }
  return step;
}

void report(const Candidate& candidate, Diagnosis& diagnosis) {
  const Effect& effect = *candidate.effect;
  std::vector<std::size_t> axes = {candidate.axis};
  if (effect.subject() == Subject::head) axes = {0, 1, 2};
  if (const auto* term = dynamic_cast<const SmoothTerm*>(&effect)) {
    UnlistedStructure& found = diagnosis.unlisted.emplace_back();
    found.driver = term->driver();
    found.form = to_string(term->form());
    found.axes = axes;
    found.shape = term->shape();
    return;
  }
  FoundEffect& found = diagnosis.effects.emplace_back();
  found.id = effect.id();
  found.axes = axes;
  const auto infos = effect.parameters();
  for (std::size_t k = 0; k < infos.size(); ++k)
    found.parameters.push_back(
        {infos[k].name, candidate.axis, candidate.hypothesis.p[k], 0, infos[k].unit});
}

}  // namespace

NaiveResult search_naively(const StudySet& set) {
  const MeasurementSet all = session(set);
  const std::vector<PoseMean> poses = pose_means(all);
  LinearModel model(set, poses);

  const VisitLog log = make_visit_log(all, set.set.description);
  const CandidateList list = all_candidates(log);
  EnlargedParameters start;
  PoseWhitening none;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    start.twelve[i] = model.twelve(i);
    none.set(i, Eigen::MatrixXd::Identity(model.poses(), model.poses()));
    none.dwell_sd_V[i] = Eigen::VectorXd::Ones(log.dwell_contrasts());
  }
  const CandidateResponses responses = candidate_responses(log, list, none, start);

  NaiveResult result;
  std::vector<std::pair<const Effect*, std::size_t>> taken;
  while (taken.size() < kMostEffects) {
    Step best;
    std::size_t chosen = 0;
    for (std::size_t c = 0; c < list.candidates.size(); ++c) {
      const Candidate& candidate = list.candidates[c];
      const std::pair<const Effect*, std::size_t> key{candidate.effect, candidate.axis};
      const bool again = std::find(taken.begin(), taken.end(), key) != taken.end();
      if (responses.place[c].count == 0 || (again && !candidate.effect->repeats())) continue;
      Step step = try_candidate(model, columns_of(responses, c, candidate.axis),
                                list.family_size[candidate.family] > 1);
      step.change += 2 * candidate.handicap;  // as in ours: a term without a name has to be better
      if (step.change >= best.change) continue;
      best = std::move(step);
      chosen = c;
    }
    if (!(best.change < 0)) break;
    const Candidate& candidate = list.candidates[chosen];
    const Columns columns = columns_of(responses, chosen, candidate.axis);
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3 * model.poses(), best.directions.cols());
    for (std::size_t b = 0; b < columns.axes.size(); ++b) {
      rows.middleRows(static_cast<Eigen::Index>(columns.axes[b]) * model.poses(), model.poses()) =
          columns.rows.middleRows(static_cast<Eigen::Index>(b) * model.poses(), model.poses()) *
          best.directions;
    }
    if (!candidate.effect->carries_over()) {
      for (Eigen::Index i = 0; i < 3; ++i)
        rows.middleRows(i * model.poses() + model.fitted_poses(),
                        model.poses() - model.fitted_poses())
            .setZero();
    }
    model.add(rows);
    taken.emplace_back(candidate.effect, candidate.axis);
    report(candidate, result.diagnosis);
  }

  PerAxis<double> fresh_mps2{};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const AxisEstimate estimate{model.twelve(i), Eigen::Matrix4d::Zero()};
    const Eigen::VectorXd error = input_referred_mps2_per_V(estimate, i) * model.error_V(i);
    fresh_mps2[i] = rms(error.tail(std::ssize(set.set.verification.poses) - 1));
  }
  result.fresh_mps2 = over_axes(fresh_mps2);
  return result;
}

}  // namespace plumbline::study
