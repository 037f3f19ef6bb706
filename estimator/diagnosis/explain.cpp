#include "estimator/diagnosis/explain.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "estimator/diagnosis/code_estimate.h"
#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/findings.h"
#include "estimator/diagnosis/fitted_terms.h"
#include "estimator/diagnosis/noise_stage.h"
#include "estimator/diagnosis/structure_parts.h"
#include "estimator/diagnosis/validated_search.h"
#include "estimator/diagnosis/verdict.h"
#include "estimator/diagnosis/wander.h"
#include "estimator/error_figures.h"
#include "estimator/fit/axis_tools.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/fit/joint_filter.h"
#include "estimator/noise/chi_squared.h"

namespace plumbline {
namespace {

/// The means of which errors are stated: as measured where that is all that most of them say.
PerAxis<Eigen::VectorXd> stated_means_V(const SearchInput& search, const SearchResult& found) {
  PerAxis<Eigen::VectorXd> means_V = found.observed.mean_V;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (found.beyond_V2[i]) means_V[i] = search.observed.mean_V[i];
  return means_V;
}

/// Four parameters of one axis out of the joint estimate.
AxisEstimate axis_of(const EnlargedEstimate& estimate, std::size_t axis) {
  const auto at = 4 * static_cast<Eigen::Index>(axis);
  return {estimate.parameters.twelve[axis], estimate.covariance.block<4, 4>(at, at)};
}

/// Variance of a visit's mean but for the drifts, which are states of the filters. To them a
/// disturbance of narrow band is one more error of each mean.
double own_variance_V2(const ExplainInput& input, const SearchResult& found, std::size_t axis,
                       std::size_t visit) {
  const PooledNoise& pooled = found.noise[axis];
  const SampleWindow& window = input.windows[visit];
  const double duration_s = window.duration_s();
  const auto row = static_cast<Eigen::Index>(visit);
  return pooled.power(kTermN) / duration_s + 2 * pooled.power(kTermQ) / (duration_s * duration_s) +
         input.processes.variance_of_bands(pooled.power, row) + found.own_V2[axis](row);
}

NoiseModel filter_noise(const ExplainInput& input, const SearchInput& search,
                        const SearchResult& found, std::size_t axis) {
  const double span_s = input.poses.back().t_mean_s - input.poses.front().t_arrival_s;
  return in_filter_terms(search.noise[axis], input.processes, found.noise[axis], span_s);
}

/// The whole enlarged model in one filter: all axes, the head and the effects' parameters.
std::optional<JointEstimate> joint_estimate(const ExplainInput& input, const SearchInput& search,
                                            const SearchResult& found) {
  JointReadings readings;
  PerAxis<NoiseModel> noise;
  const bool within_dwell = has_effect_within_dwell(found.fit.parameters);
  const auto n = std::ssize(input.poses);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    noise[axis] = filter_noise(input, search, found, axis);
    readings.mean_V[axis] = found.observed.mean_V[axis];
    readings.variance_V2[axis].resize(n);
    for (Eigen::Index k = 0; k < n; ++k)
      readings.variance_V2[axis](k) =
          own_variance_V2(input, found, axis, static_cast<std::size_t>(k));
    const Eigen::Index contrasts = within_dwell ? search.log.dwell_contrasts() : 0;
    readings.dwell_V[axis] = found.observed.dwell_V[axis].leftCols(contrasts);
    readings.dwell_sd_V[axis] = found.whitening.dwell_sd_V[axis].head(contrasts);
  }
  for (const PoseMean& pose : input.poses) readings.t_s.push_back(pose.t_mean_s);
  const JointModel model = [&](const Eigen::VectorXd& values) {
    EnlargedParameters parameters = found.fit.parameters;
    parameters.set_free_values(values);
    JointPrediction prediction{predict_stacked_V(search.log, parameters),
                               prediction_jacobian(search.log, parameters)};
    prediction.value_V.conservativeResize(prediction.slope.rows());
    return prediction;
  };
  JointFilterOptions options;
  options.flicker_correlation_s = filter_options(input.poses).flicker_correlation_s;
  // Linearised about the batch fit first: a shape that starts elsewhere may run away on its
  // tangent.
  JointEstimate estimate =
      run_joint_filter(readings, model, found.fit.parameters.free_values(), noise, options);
  if (!estimate.converged || !estimate.covariance.allFinite()) return std::nullopt;
  return estimate;
}

/// The filter on readings from which the effects are taken away.
AxisEstimate filter_estimate(const ExplainInput& input, const SearchInput& search,
                             const SearchResult& found, const Eigen::VectorXd& effect_V,
                             std::size_t axis) {
  const NoiseModel noise = filter_noise(input, search, found, axis);
  EightStateFilter filter(noise, filter_options(input.poses), input.poses.front().t_arrival_s);
  for (std::size_t k = 0; k < input.poses.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    filter.predict(input.poses[k].t_mean_s);
    const Visit& visit = search.log.visits[k];
    filter.update(specific_force_g({visit.delta_rad, visit.h_rad}, search.log.gamma),
                  found.observed.mean_V[axis](row) - effect_V(row),
                  own_variance_V2(input, found, axis, k));
  }
  return filter.parameters();
}

/// By how much the readings are others where what the search chose, like where the steps of a
/// converter begin, is one standard deviation away, each independent of the others; stacked.
std::vector<Eigen::VectorXd> choice_deviations_V(const VisitLog& log,
                                                 const EnlargedParameters& model) {
  std::vector<Eigen::VectorXd> all_V;
  const Eigen::VectorXd predicted_V = predict_stacked_V(log, model);
  for (std::size_t e = 0; e < model.effects.size(); ++e) {
    const ActiveEffect& active = model.effects[e];
    for (auto& p : active.effect->one_deviation_away(log, active.axis, active.p)) {
      EnlargedParameters away = model;
      away.effects[e].p = std::move(p);
      all_V.push_back(predict_stacked_V(log, away) - predicted_V);
    }
  }
  return all_V;
}

/// The covariance of the free parameters with what the noise and the choices of the search add to
/// it, to first order. `deviations_V`: stacked, of the readings.
Eigen::MatrixXd with_allowances(const SearchInput& search, const SearchResult& found,
                                const Eigen::MatrixXd& jacobian,
                                const std::vector<Eigen::VectorXd>& deviations_V) {
  const EnlargedFit& fit = found.fit;
  Eigen::MatrixXd covariance = with_allowance_for_noise(search, found, jacobian);
  for (const Eigen::VectorXd& deviation_V : deviations_V) {
    const Eigen::VectorXd shift = fit.covariance * (fit.whitened_jacobian.transpose() *
                                                    found.whitening.apply(deviation_V).col(0));
    covariance += shift * shift.transpose();
  }
  return covariance;
}

/// What may be true instead of each of the findings, as a part of the covariance.
/// `found`: the model by the readings that gave the rivals.
Eigen::MatrixXd covariance_among(const EnlargedParameters& found,
                                 const std::vector<Rivals>& rivals) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(found.free_count(), found.free_count());
  for (std::size_t e = 0; e < rivals.size(); ++e)
    covariance += covariance_among(found, e, rivals[e].alternatives);
  return covariance;
}

/// How the twelve follow from the means, about the fit: its Gauss–Newton step. The covariance is to
/// be filled in.
PropagatedEstimate propagated(const VisitLog& log, const EnlargedFit& fit,
                              const PoseWhitening& whitening) {
  PropagatedEstimate estimate;
  const auto n = std::ssize(log.visits);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto of_axis = fit.whitened_jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
    estimate.value[i] = fit.parameters.twelve[i];
    estimate.gain[i] =
        fit.covariance.topRows(4 * kAxisCount) * of_axis.transpose() * whitening.inverse(i);
    estimate.rounding_V2[i] = Eigen::VectorXd::Zero(n);
  }
  return estimate;
}

/// Schwarz's criterion of the pose means under the model and the noise that were found.
double schwarz_criterion(const VisitLog& log, const SearchResult& found) {
  const auto readings = static_cast<double>(mean_rows(log));
  double sum = std::log(readings) * static_cast<double>(found.fit.covariance.rows());
  for (const PooledNoise& noise : found.noise) sum += noise.likelihood_deviance;
  return sum;
}

/// Whether what is left of an axis is clearly more than its noise leaves.
bool is_far_beyond(double rms_mps2, const AxisVerdictInput& noise) {
  constexpr double kRatio = 1.5, kStandardUncertainties = 5;
  return rms_mps2 > kRatio * noise.expected_mps2 &&
         rms_mps2 - noise.expected_mps2 > kStandardUncertainties * noise.u_expected_mps2;
}

/// The twelve as the propagation sees them, but for their covariance. Rounding that was estimated
/// from the codes is part of the noise.
PropagatedEstimate certified_estimate(const ExplainInput& input, const ValidatedSearch& searched,
                                      const VisitLog& estimated_log) {
  if (searched.codes)
    return propagated(estimated_log, searched.codes->before_converter.fit,
                      searched.codes->before_converter.whitening);
  const SearchResult& found = searched.found;
  PropagatedEstimate estimate = propagated(input.log, found.fit, found.whitening);
  for (std::size_t i = 0; i < kAxisCount; ++i)
    estimate.rounding_V2[i] = found.own_V2[i] - input.known_V2[i];
  return estimate;
}

/// Gives the covariance of what was found its allowances for noise and choices.
void allow_for_choices(const SearchInput& estimated_search, const SearchInput& search,
                       std::optional<CodeEstimate>& codes, SearchResult& found) {
  const EnlargedParameters& model = found.fit.parameters;
  if (!codes) {
    found.fit.covariance = with_allowances(search, found, prediction_jacobian(search.log, model),
                                           choice_deviations_V(search.log, model));
    return;
  }
  SearchResult& before = codes->before_converter;
  before.fit.covariance = with_allowances(
      estimated_search, before, prediction_jacobian(estimated_search.log, before.fit.parameters),
      codes->deviation_V);
  static_cast<EnlargedEstimate&>(found.fit) = codes->with_converter(before.fit, found);
}

/// Errors on left-out poses against the means that are stated.
PerAxis<LeftOutErrors> stated_errors(const ValidatedSearch& searched,
                                     const PerAxis<Eigen::VectorXd>& stated_V) {
  const SearchResult& found = searched.found;
  PerAxis<LeftOutErrors> errors = searched.left_out;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const double factor = found.fit.parameters.mps2_per_V(i);
    errors[i].error_mps2 += factor * (stated_V[i] - found.observed.mean_V[i]).replicate<2, 1>();
    if (found.beyond_V2[i])
      errors[i].u_mps2 =
          (errors[i].u_mps2.array().square() + factor * factor * *found.beyond_V2[i]).sqrt();
  }
  return errors;
}

/// What the noise leaves of an axis's pose means beside the effects, not the noise that had to take
/// them up before. covariance: of the fit by the means.
Eigen::MatrixXd left_by_noise_V2(const SearchResult& found, const Eigen::MatrixXd& jacobian,
                                 const Eigen::MatrixXd& covariance, std::size_t axis) {
  const auto n = found.noise[axis].covariance.rows();
  const auto block = jacobian.middleRows(static_cast<Eigen::Index>(axis) * n, n);
  return found.noise[axis].covariance - block * covariance * block.transpose();
}

PerAxis<bool> axes_concerned(const EnlargedParameters& model) {
  PerAxis<bool> concerned{};
  for (const ActiveEffect& active : model.effects)
    for (const std::size_t axis : axes_of(active)) concerned[axis] = true;
  return concerned;
}

/// Whether more is left than the noise re-estimated beside the effects leaves: all in all, and of
/// each axis, since what is slow is many times the noise before it is much of χ².
bool more_is_left(const ExplainInput& input, const EnlargedFit& fit,
                  const PerAxis<std::optional<AxisVerdictInput>>& residual,
                  const PerAxis<double>& after_mps2) {
  const double chi2 = fit.whitened_residual.head(mean_rows(input.log)).squaredNorm();
  const double dof =
      3 * static_cast<double>(input.poses.size()) - static_cast<double>(fit.covariance.rows());
  if (chi_squared_tail(chi2, dof) < 1e-4) return true;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (residual[i] && is_far_beyond(after_mps2[i], *residual[i])) return true;
  return false;
}

/// Batch and filter estimates of the certified model: the filter of everything, or one for each
/// axis where that did not converge.
void set_final_estimates(const ExplainInput& input, const SearchInput& search,
                         const SearchResult& estimated, const std::optional<JointEstimate>& joint,
                         const EnlargedEstimate& certified, ModelEstimates& final) {
  const Gravity& gravity = input.input.description.gravity;
  EnlargedParameters bare = estimated.fit.parameters;
  bare.effects.clear();
  const auto with_V = predict_means_V(search.log, estimated.fit.parameters);
  const auto without_V = predict_means_V(search.log, bare);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto first = 4 * static_cast<Eigen::Index>(i);
    final.batch_ls[i] = with_gravity(axis_of(certified, i), gravity);
    final.ekf[i] =
        with_gravity(joint ? AxisEstimate{joint->value.segment<4>(first),
                                          joint->covariance.block<4, 4>(first, first)}
                           : filter_estimate(input, search, estimated, with_V[i] - without_V[i], i),
                     gravity);
    final.agreement_en[i] = largest_en(final.batch_ls[i], final.ekf[i]);
  }
}

/// Residuals of the poses of one axis, and what left-out poses say.
void set_errors_after(const Eigen::VectorXd& residual_mps2, const LeftOutErrors& left_out,
                      std::size_t axis, Calibration& result) {
  for (Eigen::Index k = 0; k < residual_mps2.size(); ++k)
    result.pose_results[static_cast<std::size_t>(k)].residual_after_mps2[axis] = residual_mps2(k);
  result.after.fit_pose_rms_mps2[axis] = rms(residual_mps2);
  result.after.heldout_pose_rms_mps2[axis] = rms(left_out.error_mps2);
  result.after.heldout_pose_max_abs_mps2[axis] = max_abs(left_out.error_mps2);
}

/// What the noise beside the effects leaves of one axis, of which it leaves `left_V2`; returns the
/// residual before the effects against that.
AxisVerdictInput set_floor_after(const SearchResult& found, const Eigen::MatrixXd& left_V2,
                                 std::size_t axis, Calibration& result) {
  const double factor = std::abs(found.fit.parameters.mps2_per_V(axis));
  const double mean_square_V2 =
      left_V2.trace() / static_cast<double>(left_V2.rows()) + found.beyond_V2[axis].value_or(0);
  double& floor_mps2 = result.floor_pose_rms_mps2[axis];
  const double before_mps2 = floor_mps2;
  floor_mps2 = factor * std::sqrt(std::max(mean_square_V2, 0.0));
  double& u_floor_mps2 = result.u_floor_pose_rms_mps2[axis];
  if (before_mps2 > 0) u_floor_mps2 *= floor_mps2 / before_mps2;
  return {.rms_mps2 = result.before.fit_pose_rms_mps2[axis],
          .expected_mps2 = floor_mps2,
          .u_expected_mps2 = std::hypot(u_floor_mps2, factor * scatter_of_rms_V(left_V2))};
}

}  // namespace

std::optional<Explained> explain(const ExplainInput& input, const CalibrationOptions& options,
                                 Calibration& result) {
  const VisitLog& log = input.log;
  const Observations observed = observe(input.input.run, log);
  EnlargedParameters start;
  for (std::size_t i = 0; i < kAxisCount; ++i) start.twelve[i] = result.estimates.batch_ls[i].value;
  const SearchInput search{log,   observed,     input.noise, input.processes, input.known_V2,
                           start, &input.pooled};
  SearchOptions search_options;
  search_options.seed = options.seed;
  ValidatedSearch searched =
      search_validated(search, input.input, input.poses, result.before.heldout_pose_rms_mps2,
                       options.own_effects, search_options);
  SearchResult& found = searched.found;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (found.noise[i].record_apart)
      add_remark(result.noise[i].remark,
                 "the run has less slow noise than the static record, which had no say in it");
  const auto add_noise_to = [&](Diagnosis& diagnosis, const EnlargedParameters& model) {
    add_noise(input.noise_follows, model, diagnosis);
    add_noise(wanders_beyond_record(search, found), model, diagnosis);
  };
  result.schwarz_criterion = schwarz_criterion(log, found);
  if (found.evidence.empty()) {
    result.diagnosis.not_found = detection_limits(search, searched.candidates, found);
    add_noise_to(result.diagnosis, {});
    return std::nullopt;
  }

  // What is estimated from other readings has a log of its own.
  const VisitLog& estimated_log = searched.log ? *searched.log : log;
  const SearchInput estimated_search{estimated_log,   observed, input.noise,  input.processes,
                                     search.known_V2, start,    &input.pooled};
  std::optional<CodeEstimate>& codes = searched.codes;
  if (!codes) {
    mark_parts_of_structures(log, found);
    codes = estimate_from_codes(search, input.input.run, found);
  }

  const EnlargedEstimate by_means = found.fit;
  const Eigen::MatrixXd jacobian = prediction_jacobian(log, found.fit.parameters);
  Explained explained;
  explained.estimate = certified_estimate(input, searched, estimated_log);
  // Leaving out wants the covariance under the noise that was used.
  const PerAxis<Eigen::VectorXd> stated_V = stated_means_V(search, found);
  const PerAxis<LeftOutErrors> left_out = stated_errors(searched, stated_V);
  explained.worst = worst_of(left_out);
  allow_for_choices(estimated_search, search, codes, found);
  const std::vector<Rivals> rivals =
      find_rivals(search, searched.candidates, found, options.reach.value_or(reach_of(log)));
  const EnlargedEstimate if_true = found.fit;  // if what was found is what there is
  const Eigen::MatrixXd among = covariance_among(by_means.parameters, rivals);
  found.fit.covariance += among;
  constexpr Eigen::Index kTwelve = 4 * kAxisCount;
  explained.estimate.covariance = if_true.covariance.topLeftCorner<kTwelve, kTwelve>();
  explained.estimate.alternatives = among.topLeftCorner<kTwelve, kTwelve>();
  Diagnosis diagnosis = describe_findings(search, searched.candidates, found, rivals);
  attach_gains(found, searched.gains, diagnosis);
  if (std::any_of(found.fit.parameters.effects.begin(), found.fit.parameters.effects.end(),
                  [](const ActiveEffect& active) { return active.effect->remembers(); }))
    diagnosis.history = history_of(log);

  // What certifies is estimated from these readings.
  const SearchResult& estimated = codes ? codes->before_converter : found;
  const auto joint = joint_estimate(input, estimated_search, estimated);
  if (joint) {
    EnlargedEstimate filter{estimated.fit.parameters, joint->covariance};
    filter.parameters.set_free_values(joint->value);
    attach_filter(log, if_true, codes ? codes->with_converter(filter, found) : filter, diagnosis);
  }
  set_final_estimates(input, estimated_search, estimated, joint, if_true, result.final);

  const auto predicted_V = predict_means_V(log, found.fit.parameters);
  PerAxis<std::optional<AxisVerdictInput>> residual;
  const PerAxis<bool> concerned = axes_concerned(found.fit.parameters);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto first = 4 * static_cast<Eigen::Index>(i);
    for (AxisEstimate* estimate : {&result.final.batch_ls[i], &result.final.ekf[i]})
      estimate->covariance += among.block<4, 4>(first, first);
    const double factor = found.fit.parameters.mps2_per_V(i);
    set_errors_after(factor * (stated_V[i] - predicted_V[i]), left_out[i], i, result);
    result.after.sample_rms_mps2[i] =
        std::abs(factor) * sample_rms_V(input.input.run, predicted_V[i], i);
    const AxisVerdictInput of_axis = set_floor_after(
        found, left_by_noise_V2(found, jacobian, by_means.covariance, i), i, result);
    if (concerned[i]) residual[i] = of_axis;
  }
  result.fitted_terms =
      fitted_terms(log, found.fit.parameters, predicted_V, result.floor_pose_rms_mps2);
  if (diagnosis.verdict == Verdict::explained &&
      more_is_left(input, found.fit, residual, result.after.fit_pose_rms_mps2))
    diagnosis.verdict = Verdict::partly_explained;
  diagnosis.axis_test = result.diagnosis.axis_test;
  add_noise_to(diagnosis, found.fit.parameters);
  diagnosis.reason = reason_of_findings(residual, diagnosis.reason, result.after.fit_pose_rms_mps2);
  result.diagnosis = std::move(diagnosis);
  return explained;
}

}  // namespace plumbline
