#include "estimator/diagnosis/explain.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "estimator/diagnosis/code_estimate.h"
#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/findings.h"
#include "estimator/diagnosis/heldout.h"
#include "estimator/diagnosis/noise_stage.h"
#include "estimator/diagnosis/separation.h"
#include "estimator/diagnosis/stuck_bits.h"
#include "estimator/diagnosis/verdict.h"
#include "estimator/diagnosis/wander.h"
#include "estimator/error_figures.h"
#include "estimator/fit/axis_tools.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/fit/joint_filter.h"
#include "estimator/noise/chi_squared.h"

namespace plumbline {
namespace {

double mps2_per_V(const EnlargedParameters& model, std::size_t axis) {
  return kStandardGravity_mps2 / model.twelve[axis](static_cast<Eigen::Index>(axis));
}

/// The means of which errors are stated: as measured where that is all that most of them say.
PerAxis<Eigen::VectorXd> stated_means_V(const SearchInput& search, const SearchResult& found) {
  PerAxis<Eigen::VectorXd> means_V = found.observed.mean_V;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (found.beyond_V2[i]) means_V[i] = search.observed.mean_V[i];
  return means_V;
}

/// Held-out errors of both partitions, m/s², one vector of 2n per axis.
PerAxis<Eigen::VectorXd> heldout_mps2(const Heldout& heldout, const std::vector<Blocks>& partitions,
                                      const EnlargedFit& fit) {
  const auto parts = heldout.leave_out(fit, partitions);
  PerAxis<Eigen::VectorXd> all;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    all[i].resize(parts[0].residual_V[i].size() + parts[1].residual_V[i].size());
    all[i] << parts[0].residual_V[i], parts[1].residual_V[i];
    all[i] *= mps2_per_V(fit.parameters, i);
  }
  return all;
}

/// Share of the excess held-out residual power that an effect removes.
double heldout_gain(const std::vector<LeftOut>& without, const std::vector<LeftOut>& with,
                    const std::vector<std::size_t>& axes) {
  double power_without = 0, power_with = 0, expected = 0;
  for (std::size_t part = 0; part < with.size(); ++part)
    for (const std::size_t axis : axes) {
      power_without += without[part].power[axis];
      power_with += with[part].power[axis];
      expected += static_cast<double>(with[part].residual_V[axis].size());
    }
  return share_removed(power_without, power_with, expected);
}

/// Four parameters of one axis out of the joint estimate.
AxisEstimate axis_of(const EnlargedFit& fit, std::size_t axis) {
  const auto at = 4 * static_cast<Eigen::Index>(axis);
  return {fit.parameters.twelve[axis], fit.covariance.block<4, 4>(at, at)};
}

/// Variance of a visit's mean but for the drifts, which are states of the filters.
double own_variance_V2(const ExplainInput& input, const SearchResult& found, std::size_t axis,
                       std::size_t visit) {
  const PooledNoise& pooled = found.noise[axis];
  const SampleWindow& window = input.windows[visit];
  const double duration_s = window.step_s * static_cast<double>(window.count);
  return pooled.power(kTermN) / duration_s + 2 * pooled.power(kTermQ) / (duration_s * duration_s) +
         found.own_V2[axis](static_cast<Eigen::Index>(visit));
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
    if (!within_dwell) {
      const Eigen::Index rows = mean_rows(search.log);
      prediction.value_V.conservativeResize(rows);
      prediction.slope.conservativeResize(rows, Eigen::NoChange);
    }
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

/// A model without one of its effects, and the share of the left-out excess that the effect
/// removes.
struct Without {
  EnlargedFit fit;
  double gain = 0;
};
Without without_one(const SearchInput& search, const Heldout& heldout,
                    const std::vector<Blocks>& partitions, const SearchResult& found,
                    const std::vector<LeftOut>& with, std::size_t k) {
  const ActiveEffect& removed = found.fit.parameters.effects[k];
  Without without{fit_enlarged(search.log, found.observed, found.whitening,
                               without_effect(found.fit.parameters, k))};
  if (!without.fit.determined) return without;
  // What changes within the dwell may hardly be seen in the means.
  without.gain = std::max(
      heldout_gain(heldout.leave_out(without.fit, partitions), with, axes_of(removed)),
      heldout_dwell_gain(search.log, found.observed, found.whitening, found.fit, k, partitions));
  return without;
}

/// Effects that do not help where they were not fitted are no effects. Says which were dropped, one
/// after the other, by their places in what was left of the model; `gains`: of those that stay.
std::vector<std::size_t> drop_what_does_not_carry(const SearchInput& search, const Heldout& heldout,
                                                  const std::vector<Blocks>& partitions,
                                                  SearchResult& found, std::vector<double>& gains) {
  std::vector<std::size_t> all_dropped;
  for (bool dropped = true; dropped && !found.evidence.empty();) {
    dropped = false;
    gains.clear();
    const auto with = heldout.leave_out(found.fit, partitions);
    for (std::size_t k = 0; k < found.evidence.size(); ++k) {
      const ActiveEffect& active = found.fit.parameters.effects[k];
      Without without = without_one(search, heldout, partitions, found, with, k);
      // One pose's own error cannot be predicted from other poses.
      const bool own =
          active.effect->concerns_one_visit() || active.effect->certain(search.log, active.axis);
      if (without.gain > 0 || own || !without.fit.determined) {
        gains.push_back(std::max(without.gain, 0.0));
        continue;
      }
      found.remove(k);
      found.fit = std::move(without.fit);
      all_dropped.push_back(k);
      dropped = true;
      break;
    }
  }
  return all_dropped;
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

/// What a search found.
struct Searched {
  std::unique_ptr<const VisitLog> log;  ///< that `codes` are from; null: that of the search
  CandidateList candidates;
  SearchResult found;
  std::optional<CodeEstimate> codes;
};

Searched search_readings(const ExplainInput& input, const SearchInput& search,
                         const CalibrationOptions& options) {
  SearchOptions search_options;
  search_options.seed = options.seed;
  if (auto beside_bits = search_beside_stuck_bits(
          search, input.input, design_matrix(input.poses, input.input.description.gravity),
          options.own_effects, search_options))
    return {std::move(beside_bits->log), std::move(beside_bits->candidates),
            std::move(beside_bits->found), std::move(beside_bits->given_back)};
  CandidateList candidates = all_candidates(search.log, options.own_effects);
  SearchResult found = search_effects(search, candidates, search_options);
  return {nullptr, std::move(candidates), std::move(found), std::nullopt};
}

/// Effects with which the poses that were left out of the fit come out far worse than by the 12
/// parameters are none, however much more like noise they make the rest: those of the axis go.
void drop_what_worsens(const SearchInput& search, const Heldout& heldout,
                       const std::vector<Blocks>& partitions, const PerAxis<double>& before_mps2,
                       Searched& searched) {
  constexpr double kFar = 2;  // slow noise alone may make it worse by a little
  SearchResult& found = searched.found;
  const std::size_t size = found.evidence.size();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (!(rms(heldout_mps2(heldout, partitions, found.fit)[axis]) > kFar * before_mps2[axis]))
      continue;
    for (std::size_t k = found.evidence.size(); k-- > 0;) {
      const ActiveEffect& active = found.fit.parameters.effects[k];
      if (active.effect->subject() == Subject::sensor && active.axis == axis &&
          !active.effect->certain(search.log, axis))
        found.remove(k);
    }
    found.fit = fit_enlarged(search.log, found.observed, found.whitening, found.fit.parameters);
  }
  if (found.evidence.size() < size)
    found.responses =
        candidate_responses(search.log, searched.candidates, found.whitening, found.fit.parameters);
}

/// Leaves of `searched` what carries over to poses that were left out; returns the gains there.
/// `heldout` is that of what was found, `estimated` the input that the codes are from.
std::vector<double> keep_what_carries(const SearchInput& search, const SearchInput& estimated,
                                      const Heldout& heldout, const std::vector<Blocks>& partitions,
                                      Searched& searched) {
  SearchResult& found = searched.found;
  std::vector<double> gains;
  std::vector<std::size_t> dropped;
  if (searched.codes) {
    // Edges of the bits hide what carries over.
    SearchResult& without = searched.codes->before_converter;
    dropped = drop_what_does_not_carry(
        estimated, Heldout(estimated.log, without.observed.mean_V, without.whitening), partitions,
        without, gains);
    drop_effects(search, dropped, found, *searched.codes);
    const auto with = heldout.leave_out(found.fit, partitions);
    for (std::size_t k = gains.size(); k < found.evidence.size(); ++k)
      gains.push_back(std::max(0.0, without_one(search, heldout, partitions, found, with, k).gain));
  } else {
    dropped = drop_what_does_not_carry(search, heldout, partitions, found, gains);
  }
  if (!dropped.empty())
    found.responses =
        candidate_responses(search.log, searched.candidates, found.whitening, found.fit.parameters);
  return gains;
}

}  // namespace

std::optional<WorstError> explain(const ExplainInput& input, const CalibrationOptions& options,
                                  Calibration& result) {
  const VisitLog& log = input.log;
  const Observations observed = observe(input.input.run, log);
  EnlargedParameters start;
  for (std::size_t i = 0; i < kAxisCount; ++i) start.twelve[i] = result.estimates.batch_ls[i].value;
  const SearchInput search{log,   observed,     input.noise, input.processes, input.known_V2,
                           start, &input.pooled};
  Searched searched = search_readings(input, search, options);
  SearchResult& found = searched.found;
  const auto add_noise_to = [&](Diagnosis& diagnosis, const EnlargedParameters& model) {
    add_noise(input.noise_follows, model, diagnosis);
    add_noise(wanders_beyond_record(search, found), model, diagnosis);
  };
  const auto without_effects = [&]() -> std::optional<WorstError> {
    result.diagnosis.not_found = detection_limits(search, searched.candidates, found);
    add_noise_to(result.diagnosis, {});
    return std::nullopt;
  };
  if (found.evidence.empty()) return without_effects();

  // What is estimated from other readings has a log of its own.
  const VisitLog& estimated_log = searched.log ? *searched.log : log;
  const SearchInput estimated_search{estimated_log,   observed, input.noise,  input.processes,
                                     search.known_V2, start,    &input.pooled};
  const PerAxis<Eigen::VectorXd>& mean_V = found.observed.mean_V;
  const Heldout heldout(log, mean_V, found.whitening);
  const std::vector<Blocks> partitions = {time_blocks(input.poses), position_blocks(input.poses)};
  if (!searched.codes)
    drop_what_worsens(search, heldout, partitions, result.before.heldout_pose_rms_mps2, searched);
  const std::vector<double> gains =
      keep_what_carries(search, estimated_search, heldout, partitions, searched);
  if (found.evidence.empty()) return without_effects();
  std::optional<CodeEstimate>& codes = searched.codes;
  if (!codes) codes = estimate_from_codes(search, input.input.run, found);

  // Leaving out and the expected residual want the covariance under the noise that was used.
  const PerAxis<Eigen::VectorXd> stated_V = stated_means_V(search, found);
  auto heldout_errors_mps2 = heldout_mps2(heldout, partitions, found.fit);
  for (std::size_t i = 0; i < kAxisCount; ++i)
    heldout_errors_mps2[i] +=
        mps2_per_V(found.fit.parameters, i) * (stated_V[i] - mean_V[i]).replicate<2, 1>();
  const Eigen::MatrixXd under_this_noise = found.fit.covariance;
  const Eigen::MatrixXd jacobian = prediction_jacobian(log, found.fit.parameters);
  if (codes) {
    SearchResult& before = codes->before_converter;
    before.fit.covariance = with_allowances(
        estimated_search, before, prediction_jacobian(estimated_log, before.fit.parameters),
        codes->deviation_V);
    static_cast<EnlargedEstimate&>(found.fit) = codes->with_converter(before.fit, found);
  } else {
    found.fit.covariance =
        with_allowances(search, found, jacobian, choice_deviations_V(log, found.fit.parameters));
  }
  Diagnosis diagnosis =
      describe_findings(search, searched.candidates, found, options.reach.value_or(reach_of(log)));
  attach_gains(found.evidence, gains, diagnosis);
  if (std::any_of(found.fit.parameters.effects.begin(), found.fit.parameters.effects.end(),
                  [](const ActiveEffect& active) { return active.effect->remembers(); }))
    diagnosis.history = history_of(log);

  // What certifies is estimated from these readings.
  const SearchResult& estimated = codes ? codes->before_converter : found;
  const auto predicted_V = predict_means_V(log, found.fit.parameters);
  const auto estimated_V = predict_means_V(estimated_log, estimated.fit.parameters);
  EnlargedParameters bare = found.fit.parameters;
  bare.effects.clear();
  const auto twelve_V = predict_means_V(log, bare);
  const Gravity& gravity = input.input.description.gravity;

  const auto n = std::ssize(input.poses);
  const auto joint = joint_estimate(input, estimated_search, estimated);
  if (joint) {
    EnlargedEstimate filter{estimated.fit.parameters, joint->covariance};
    filter.parameters.set_free_values(joint->value);
    attach_filter(log, codes ? codes->with_converter(filter, found) : filter, diagnosis);
  }
  PerAxis<bool> concerned{};
  for (const ActiveEffect& active : found.fit.parameters.effects)
    for (const std::size_t axis : axes_of(active)) concerned[axis] = true;
  PerAxis<std::optional<AxisVerdictInput>> residual;
  WorstError worst;
  const double chi2 = found.fit.whitened_residual.head(mean_rows(log)).squaredNorm();
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const double factor = mps2_per_V(found.fit.parameters, i);
    result.final.batch_ls[i] = with_gravity(axis_of(found.fit, i), gravity);
    const auto first = 4 * static_cast<Eigen::Index>(i);
    result.final.ekf[i] = with_gravity(
        joint
            ? AxisEstimate{joint->value.segment<4>(first),
                           joint->covariance.block<4, 4>(first, first)}
            : filter_estimate(input, estimated_search, estimated, estimated_V[i] - twelve_V[i], i),
        gravity);
    result.final.agreement_en[i] = largest_en(result.final.batch_ls[i], result.final.ekf[i]);
    const Eigen::VectorXd residual_mps2 = factor * (stated_V[i] - predicted_V[i]);
    result.after.fit_pose_rms_mps2[i] = rms(residual_mps2);
    // The noise estimated beside the effects, not the one that had to take them up.
    const auto block = jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
    const Eigen::MatrixXd left_V2 =
        found.noise[i].covariance - block * under_this_noise * block.transpose();
    const double floor_mps2 =
        std::abs(factor) *
        std::sqrt(std::max(
            left_V2.trace() / static_cast<double>(n) + found.beyond_V2[i].value_or(0), 0.0));
    if (result.floor_pose_rms_mps2[i] > 0) {
      result.u_floor_pose_rms_mps2[i] *= floor_mps2 / result.floor_pose_rms_mps2[i];
    }
    result.floor_pose_rms_mps2[i] = floor_mps2;
    if (concerned[i])
      residual[i] = {.rms_mps2 = result.before.fit_pose_rms_mps2[i],
                     .expected_mps2 = floor_mps2,
                     .u_expected_mps2 = std::hypot(result.u_floor_pose_rms_mps2[i],
                                                   std::abs(factor) * scatter_of_rms_V(left_V2))};
    result.after.heldout_pose_rms_mps2[i] = rms(heldout_errors_mps2[i]);
    result.after.heldout_pose_max_abs_mps2[i] = max_abs(heldout_errors_mps2[i]);
    result.after.sample_rms_mps2[i] =
        std::abs(factor) * sample_rms_V(input.input.run, predicted_V[i], i);
    for (Eigen::Index k = 0; k < residual_mps2.size(); ++k) {
      result.pose_results[static_cast<std::size_t>(k)].residual_after_mps2[i] = residual_mps2(k);
    }
    if (result.after.heldout_pose_max_abs_mps2[i] > worst.error_mps2) {
      worst.error_mps2 = result.after.heldout_pose_max_abs_mps2[i];
      worst.u_mps2 = result.after.heldout_pose_rms_mps2[i];
    }
  }
  // What is left against the noise that was re-estimated beside the effects.
  const double dof = 3 * static_cast<double>(input.poses.size()) -
                     static_cast<double>(found.fit.covariance.rows());
  if (chi_squared_tail(chi2, dof) < 1e-4 && diagnosis.verdict == Verdict::explained) {
    diagnosis.verdict = Verdict::partly_explained;
  }
  diagnosis.axis_test = result.diagnosis.axis_test;
  add_noise_to(diagnosis, found.fit.parameters);
  diagnosis.reason = reason_of_findings(residual, diagnosis.reason, result.after.fit_pose_rms_mps2);
  result.diagnosis = std::move(diagnosis);
  return worst;
}

}  // namespace plumbline
