// What those who know more than the engine would reach: the oracle, whose readings hold no effect,
// and someone who is told which effect there is.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "estimator/diagnosis/enlarged_fit.h"
#include "estimator/diagnosis/restored_model.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/fit/least_squares.h"
#include "estimator/pose_means.h"
#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

/// The effect of the estimator that a simulated one is.
const Effect* counterpart(const sim::EffectSetting& truth,
                          const std::vector<std::unique_ptr<Effect>>& of_columns) {
  for (const Effect* effect : effect_catalogue())
    if (effect->id() == truth.id) return effect;
  for (const auto& effect : of_columns) {
    const bool bias = effect->parameters().front().unit.starts_with("g");
    if (effect->id() == truth.id && (truth.form == "bias") == bias) return effect.get();
  }
  return nullptr;
}

/// The effect with its true values; what only the estimator's model of it has stands as where a
/// search would start, one of these after the other.
std::vector<ActiveEffect> true_effects(const Effect& effect, const sim::EffectSetting& truth,
                                       const VisitLog& log) {
  const std::size_t axis = effect.subject() == Subject::head ? 0 : truth.axes.front();
  const auto infos = effect.parameters();
  std::vector<ActiveEffect> all;
  for (Hypothesis& hypothesis : effect.hypotheses(log, axis)) {
    for (std::size_t k = 0; k < infos.size(); ++k) {
      const auto value = truth.parameters.find(infos[k].name);
      if (value != truth.parameters.end()) hypothesis.p[k] = value->second;
      if (infos[k].name == "poses") hypothesis.p[k] = static_cast<double>(truth.poses.front());
    }
    const bool known = std::any_of(all.begin(), all.end(), [&](const ActiveEffect& active) {
      return active.p == hypothesis.p;
    });
    if (!known) all.push_back(activate(effect, axis, hypothesis));
  }
  return all;
}

/// The true covariance; the contrasts of the dwells scatter as without the effect.
PoseWhitening true_whitening(const StudySet& set, const VisitLog& log) {
  PoseWhitening whitening;
  const Observations plain = observe(set.plain.run, log);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    whitening.set(i, set.covariance_V2[i]);
    const Eigen::MatrixXd& dwell_V = plain.dwell_V[i];
    whitening.dwell_sd_V[i] =
        (dwell_V.colwise().squaredNorm() / static_cast<double>(dwell_V.rows())).cwiseSqrt();
    // What no dwell resolves is zero with and without the effect.
    whitening.dwell_sd_V[i] =
        (whitening.dwell_sd_V[i].array() > 0).select(whitening.dwell_sd_V[i], 1);
  }
  return whitening;
}

/// The run as the estimator sees it, and the true noise of its readings.
struct Readings {
  VisitLog log;
  Observations observed;
  PoseWhitening whitening;
};
Readings readings_of(const StudySet& set) {
  VisitLog log = make_visit_log(set.set.run, set.set.description);
  Observations observed = observe(set.set.run, log);
  PoseWhitening whitening = true_whitening(set, log);
  return {std::move(log), std::move(observed), std::move(whitening)};
}

/// Root mean square over the fresh poses that count, which are the last of `all` poses.
double fresh_rms(const StudySet& set, const Eigen::VectorXd& all) {
  return rms(all.tail(std::ssize(set.set.verification.poses) - 1));
}

}  // namespace

double fresh_error_mps2(const StudySet& set, const std::vector<PoseMean>& poses,
                        const VisitLog& log, const EnlargedParameters& model) {
  const auto predicted_V = predict_means_V(log, model);
  PerAxis<double> mps2{};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const AxisEstimate twelve{model.twelve[i], Eigen::Matrix4d::Zero()};
    mps2[i] = fresh_rms(
        set, input_referred_mps2_per_V(twelve, i) * (mean_voltages(poses, i) - predicted_V[i]));
  }
  return over_axes(mps2);
}

namespace {

/// What an effect that the simulator refers to a value of the room adds to the scale of its axes
/// where the column has its mean.
double added_at_mean(const StudySet& set, const sim::EffectSetting& effect) {
  const SampleTable& samples = set.plain.run.samples;
  const sim::Room& room = set.world.room;
  if (effect.id == "own.ratiometric")
    return -effect.parameters.at("c") * (mean_of_column(samples, "supply_V") / room.supply_V - 1);
  if (effect.id == "own.swelling")
    return effect.parameters.at("c") * (mean_of_column(samples, "rh_pct") - room.rh_pct);
  return 0;
}

}  // namespace

PerAxis<Eigen::Vector4d> true_twelve(const StudySet& set) {
  PerAxis<Eigen::Vector4d> truth;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto& K = set.world.triad.K_V_per_g[i];
    truth[i] << K[0], K[1], K[2], set.world.triad.U0_V[i];
  }
  for (const sim::EffectSetting& effect : set.effects)
    for (const std::size_t i : effect.axes)
      truth[i](static_cast<Eigen::Index>(i)) *= 1 + added_at_mean(set, effect);
  return truth;
}

void score_oracle(const StudySet& set, SetOutcome& outcome) {
  const auto poses = pose_means(set.plain.run);
  const auto fresh = pose_means(set.plain.verification);
  const Eigen::MatrixXd A = design_matrix(poses, set.plain.description.gravity);
  const Eigen::MatrixXd A_fresh = design_matrix(fresh, set.plain.description.gravity);
  PerAxis<double> fresh_mps2{};
  PerAxis<double> heldout_mps2{};
  PerAxis<double> ordinary_mps2{};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const Eigen::VectorXd y = mean_voltages(poses, i);
    const auto fit = fit_generalised(A, y, set.covariance_V2[i]);
    assert(fit);
    const double factor = input_referred_mps2_per_V(fit->estimate, i);
    const Eigen::VectorXd y_fresh = mean_voltages(fresh, i);
    fresh_mps2[i] = fresh_rms(set, factor * (y_fresh - A_fresh * fit->estimate.value));
    const Eigen::VectorXd ordinary = solve_least_squares(A, y).x;
    ordinary_mps2[i] = fresh_rms(set, factor * (y_fresh - A_fresh * ordinary));
    Eigen::VectorXd heldout(2 * y.size());
    heldout << heldout_residuals(A, y, set.covariance_V2[i], time_blocks(poses)).residual_V,
        heldout_residuals(A, y, set.covariance_V2[i], position_blocks(poses)).residual_V;
    heldout_mps2[i] = rms(factor * heldout);
  }
  outcome.oracle = {over_axes(fresh_mps2), over_axes(heldout_mps2)};
  outcome.plain_oracle_fresh = over_axes(ordinary_mps2);
}

namespace {

/// Schwarz's criterion of what is left of the run's readings, which are `rows`.
double criterion(double chi2, Eigen::Index rows, Eigen::Index parameters) {
  return chi2 + static_cast<double>(parameters) * std::log(static_cast<double>(rows));
}

/// By the estimator's models of the effects.
Told told_listed(const StudySet& set) {
  const auto [log, observed, whitening] = readings_of(set);
  const auto of_columns = covariate_effects(log);
  EnlargedFit told;
  told.parameters.twelve = true_twelve(set);
  if (set.effects.empty()) told = fit_enlarged(log, observed, whitening, told.parameters);
  for (const sim::EffectSetting& truth : set.effects) {
    const Effect* effect = counterpart(truth, of_columns);
    assert(effect != nullptr);
    EnlargedFit best;
    best.chi2 = std::numeric_limits<double>::infinity();
    for (const ActiveEffect& active : true_effects(*effect, truth, log)) {
      EnlargedFit fit =
          fit_holding_shapes(log, observed, whitening, with_effect(told.parameters, active), 0);
      if (fit.chi2 < best.chi2) best = std::move(fit);
    }
    if (best.parameters.effects.empty()) return {};
    told = std::move(best);
  }
  const double left = criterion(told.chi2, mean_rows(log), told.parameters.free_count());
  std::erase_if(told.parameters.effects,
                [](const ActiveEffect& active) { return !active.effect->carries_over(); });

  const MeasurementSet all = session(set);
  return {fresh_error_mps2(set, pose_means(all), make_visit_log(all, set.set.description),
                           told.parameters),
          left};
}

/// What the 12 parameters do to the stacked readings.
Eigen::MatrixXd twelve_columns(const StudySet& set, const VisitLog& log) {
  const Eigen::MatrixXd A = design_matrix(pose_means(set.set.run), set.set.description.gravity);
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(stacked_rows(log), 4 * kAxisCount);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    columns.block(axis * A.rows(), 4 * axis, A.rows(), 4) = A;
  }
  return columns;
}

/// By what the effects do, of which the amplitude is estimated.
Told told_response(const SetDesign& design, const StudySet& set) {
  sim::World plain = set.world;
  plain.effects.clear();
  const sim::RecordedSet with = record_without_noise(design, set.world);
  const sim::RecordedSet without = record_without_noise(design, plain);
  const auto [log, observed, whitening] = readings_of(set);
  Eigen::MatrixXd columns(stacked_rows(log), 13);
  columns.leftCols(12) = twelve_columns(set, log);
  columns.col(12) = stacked_V(observe(with.run, log)) - stacked_V(observe(without.run, log));
  const Eigen::MatrixXd whitened = whitening.apply(columns);
  const Eigen::VectorXd y = whitening.apply(stacked_V(observed));
  const Eigen::VectorXd told = solve_least_squares(whitened, y).x;

  const auto fresh = pose_means(set.set.verification);
  const Eigen::MatrixXd A_fresh = design_matrix(fresh, set.set.description.gravity);
  const auto fresh_with = pose_means(with.verification);
  const auto fresh_without = pose_means(without.verification);
  PerAxis<double> mps2{};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const AxisEstimate twelve{told.segment<4>(4 * static_cast<Eigen::Index>(i)),
                              Eigen::Matrix4d::Zero()};
    mps2[i] = fresh_rms(
        set, input_referred_mps2_per_V(twelve, i) *
                 (mean_voltages(fresh, i) - A_fresh * twelve.value -
                  told(12) * (mean_voltages(fresh_with, i) - mean_voltages(fresh_without, i))));
  }
  // Who is not told would have to estimate all parameters of the effect.
  const auto parameters = 12 + std::ssize(set.effects.front().parameters);
  return {over_axes(mps2),
          criterion((y - whitened * told).squaredNorm(), mean_rows(log), parameters)};
}

}  // namespace

Told told_effects(const SetDesign& design, const StudySet& set) {
  return kind_of(design) == SetKind::own ? told_response(design, set) : told_listed(set);
}

double criterion_of(const StudySet& set, const Calibration& calibration) {
  const auto [log, observed, whitening] = readings_of(set);
  const RestoredModel found =
      restore_model(certified_model(calibration), log, RestoredFor::its_run);
  Eigen::Index parameters = 12;
  const auto count_estimated = [&parameters](const std::vector<EffectParameter>& reported) {
    parameters += std::count_if(reported.begin(), reported.end(),
                                [](const EffectParameter& p) { return p.estimated; });
  };
  for (const FoundEffect& effect : calibration.diagnosis.effects)
    count_estimated(effect.parameters);
  for (const UnlistedStructure& each : calibration.diagnosis.unlisted)
    count_estimated(each.parameters);
  // The twelve once more under the true noise, which the search did not know.
  const Eigen::MatrixXd twelve = whitening.apply(twelve_columns(set, log));
  const Eigen::VectorXd left =
      whitening.apply(stacked_V(observed) - predict_stacked_V(log, found.parameters));
  return criterion((left - twelve * solve_least_squares(twelve, left).x).squaredNorm(),
                   mean_rows(log), parameters);
}

}  // namespace plumbline::study
