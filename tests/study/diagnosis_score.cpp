// Scores calibrations of the study's sets against their truth.
#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/diagnosis/restored_model.h"
#include "estimator/error_figures.h"
#include "estimator/pose_means.h"
#include "rig/sim/effects/effect.h"
#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

constexpr double kCoverage = 1.96;  // of a 95 % interval, in u

std::string axes_text(const std::vector<std::size_t>& axes) {
  std::string text;
  for (const std::size_t axis : axes) text += kAxisName[axis];
  return text;
}

bool is_head(const std::string& id) { return id.starts_with("rig."); }

/// `bias` or `scale` of a recorded column, told by the unit of its coefficient.
std::string form_of(const FoundEffect& found) {
  if (found.parameters.empty()) return "";
  return found.parameters.front().unit.starts_with("g") ? "bias" : "scale";
}

bool same_id(const sim::EffectSetting& truth, const FoundEffect& found) {
  if (truth.id != found.id) return false;
  return !truth.id.starts_with("covariate:") || truth.form == form_of(found);
}

bool same_axes(const sim::EffectSetting& truth, const FoundEffect& found) {
  return is_head(truth.id) || truth.axes == found.axes;
}

bool covers_axes(const sim::EffectSetting& truth, const std::vector<std::size_t>& axes) {
  return is_head(truth.id) || std::all_of(truth.axes.begin(), truth.axes.end(), [&](std::size_t a) {
           return std::find(axes.begin(), axes.end(), a) != axes.end();
         });
}

/// True when `id` is one of the alternatives, or a term of one that is a sum.
bool states(const FoundEffect& found, const std::string& id) {
  return std::any_of(found.alternatives.begin(), found.alternatives.end(),
                     [&](const std::string& alternative) {
                       return ("+" + alternative + "+").find("+" + id + "+") != std::string::npos;
                     });
}

/// Which true effect each finding stands for, and the other way round.
void match(const std::vector<sim::EffectSetting>& truth, const Diagnosis& diagnosis,
           Claims& outcome) {
  std::vector<bool> used(diagnosis.effects.size(), false);
  std::vector<bool> settled(truth.size(), false);
  for (std::size_t t = 0; t < truth.size(); ++t) {
    for (std::size_t f = 0; f < used.size(); ++f) {
      const FoundEffect& found = diagnosis.effects[f];
      if (used[f] || !same_id(truth[t], found) || !covers_axes(truth[t], found.axes)) continue;
      used[f] = settled[t] = true;
      ++outcome.named_or_stated;
      if (same_axes(truth[t], found)) {
        ++outcome.named;
      } else {
        ++outcome.wrong;  // a further axis is a further claim
      }
      break;
    }
  }
  // A finding may state several true effects as one sum.
  for (std::size_t f = 0; f < used.size(); ++f) {
    bool stands_for_one = used[f];
    for (std::size_t t = 0; t < truth.size(); ++t) {
      const FoundEffect& found = diagnosis.effects[f];
      if (settled[t] || !states(found, truth[t].id)) continue;
      if (!is_head(found.id) && !covers_axes(truth[t], found.axes)) continue;
      settled[t] = stands_for_one = true;
      ++outcome.named_or_stated;
    }
    if (!stands_for_one) ++outcome.wrong;
  }
  outcome.unlisted = static_cast<int>(diagnosis.unlisted.size());
}

/// True when `driver` is one of the right ones, in which `_i` stands for any of the axes.
bool is_right_driver(const StudyEffect& effect, const std::vector<std::size_t>& axes,
                     const std::string& driver) {
  return std::any_of(effect.drivers.begin(), effect.drivers.end(), [&](const std::string& right) {
    if (!right.ends_with("_i")) return driver == right;
    return std::any_of(axes.begin(), axes.end(), [&](std::size_t axis) {
      return driver == right.substr(0, right.size() - 1) + kAxisName[axis];
    });
  });
}

/// Effects outside the list: which findings name their drivers, which are listed names that are no
/// false claim (diagnosis_own.cpp), and which are claimed instead.
void match_drivers(const SetDesign& design, const std::vector<sim::EffectSetting>& truth,
                   const Diagnosis& diagnosis, Claims& outcome) {
  std::vector<bool> right(diagnosis.unlisted.size(), false);
  std::vector<bool> near(diagnosis.effects.size(), false);
  bool any_listed = false;
  for (std::size_t t = 0; t < truth.size(); ++t) {
    const StudyEffect* effect = find_study_effect(design.effects[t]);
    assert(effect != nullptr);
    if (effect->drivers.empty()) {
      any_listed = true;
      continue;
    }
    bool by_driver = false;
    for (std::size_t f = 0; f < right.size(); ++f) {
      const UnlistedStructure& found = diagnosis.unlisted[f];
      if (!is_right_driver(*effect, truth[t].axes, found.driver)) continue;
      if (!covers_axes(truth[t], found.axes)) continue;
      by_driver = right[f] = true;
    }
    bool by_name = false;
    for (std::size_t f = 0; f < near.size(); ++f) {
      const FoundEffect& found = diagnosis.effects[f];
      const auto& names = effect->near;
      if (std::find(names.begin(), names.end(), found.id) == names.end()) continue;
      if (!covers_axes(truth[t], found.axes)) continue;
      if (found.id.starts_with("covariate:") &&
          form_of(found) != sim::find_effect(truth[t].id)->form)
        continue;
      by_name = near[f] = true;
    }
    outcome.driver_right += by_driver || by_name ? 1 : 0;
    outcome.near_name += by_name && !by_driver ? 1 : 0;
  }
  const auto near_names = static_cast<int>(std::count(near.begin(), near.end(), true));
  outcome.wrong += static_cast<int>(std::count(right.begin(), right.end(), false)) - near_names;
  if (!any_listed && !truth.empty())
    outcome.listed_instead = static_cast<int>(diagnosis.effects.size()) - near_names;
}

void check_parameters(const std::vector<sim::EffectSetting>& truth, const Diagnosis& diagnosis,
                      SetOutcome& outcome) {
  for (const sim::EffectSetting& effect : truth) {
    for (const FoundEffect& found : diagnosis.effects) {
      if (!same_id(effect, found) || !same_axes(effect, found)) continue;
      for (const EffectParameter& p : found.parameters) {
        const auto value = effect.parameters.find(p.name);
        if (value == effect.parameters.end() || !(p.u > 0) || p.name == "mean") continue;
        ++outcome.parameters;
        outcome.parameters_within += std::abs(p.value - value->second) <= kCoverage * p.u ? 1 : 0;
      }
    }
  }
}

void check_twelve(const StudySet& set, const Calibration& calibration, SetOutcome& outcome) {
  const PerAxis<Eigen::Vector4d> truth = true_twelve(set);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const AxisEstimate& estimate = calibration.final.batch_ls[i];
    for (Eigen::Index k = 0; k < 4; ++k) {
      const double z =
          std::abs(estimate.value(k) - truth[i](k)) / std::sqrt(estimate.covariance(k, k));
      (k < 3 ? outcome.K_within : outcome.U0_within) += z <= kCoverage ? 1 : 0;
      double& worst = k < 3 ? outcome.worst_K : outcome.worst_U0;
      worst = std::max(worst, z);
    }
  }
}

/// Errors of the 12 parameters and of the certified model on the fresh poses of the session.
void score_fresh(const StudySet& set, const CertifiedModel& model, SetOutcome& outcome) {
  const MeasurementSet all = session(set);
  const auto poses = pose_means(all);
  const VisitLog log = make_visit_log(all, set.set.description);
  EnlargedParameters alone;
  for (std::size_t i = 0; i < kAxisCount; ++i) alone.twelve[i] = model.twelve[i].value;
  const RestoredModel restored = restore_model(model, log);
  outcome.before.fresh = fresh_error_mps2(set, poses, log, alone);
  outcome.after.fresh = fresh_error_mps2(set, poses, log, restored.parameters);
}

std::string describe_truth(const std::vector<sim::EffectSetting>& effects) {
  std::string text;
  for (const sim::EffectSetting& effect : effects) {
    text += (text.empty() ? "" : "; ") + effect.id;
    if (effect.id.starts_with("covariate:")) text += ":" + effect.form;
    if (!is_head(effect.id)) text += "(" + axes_text(effect.axes) + ")";
    for (const auto& [name, value] : effect.parameters)
      text += fmt::format(" {}={:.6g}", name, value);
    for (const long long pose : effect.poses) text += fmt::format(" #{}", pose);
  }
  return text;
}

std::string describe_found(const Diagnosis& diagnosis) {
  std::string text;
  const auto add_alternatives = [&](const Ambiguity& finding) {
    if (!finding.alternatives.empty())
      text += fmt::format(" [{}]", fmt::join(finding.alternatives, " | "));
  };
  for (const FoundEffect& effect : diagnosis.effects) {
    text += fmt::format("{}{}({})", text.empty() ? "" : "; ", effect.id, axes_text(effect.axes));
    for (const EffectParameter& p : effect.parameters)
      text += fmt::format(" {}={:.5g}±{:.2g}", p.name, p.value, p.u);
    add_alternatives(effect);
  }
  for (const UnlistedStructure& found : diagnosis.unlisted) {
    text += fmt::format("{}unlisted:{}:{}({}) {}", text.empty() ? "" : "; ", found.driver,
                        found.form, axes_text(found.axes), found.shape);
    add_alternatives(found);
  }
  return text;
}

}  // namespace

double over_axes(const PerAxis<double>& rms_mps2) {
  double sum = 0;
  for (const double value : rms_mps2) sum += value * value;
  return std::sqrt(sum / kAxisCount);
}

MeasurementSet session(const StudySet& set) {
  MeasurementSet all = set.set.run;
  const MeasurementSet& fresh = set.set.verification;
  const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (Pose pose : fresh.poses) {
    pose.number = std::ssize(all.poses);
    pose.first += set.set.run.samples.size();
    all.poses.push_back(pose);
  }
  append(all.samples.t_s, fresh.samples.t_s);
  for (std::size_t i = 0; i < kAxisCount; ++i) append(all.samples.u_V[i], fresh.samples.u_V[i]);
  append(all.samples.temp_C, fresh.samples.temp_C);
  for (std::size_t c = 0; c < all.samples.covariates.size(); ++c)
    append(all.samples.covariates[c].value, fresh.samples.covariates[c].value);
  return all;
}

Claims check_claims(const SetDesign& design, const StudySet& set, const Diagnosis& diagnosis) {
  Claims claims;
  claims.found = describe_found(diagnosis);
  claims.effects = static_cast<int>(set.effects.size());
  match(set.effects, diagnosis, claims);
  match_drivers(design, set.effects, diagnosis, claims);
  return claims;
}

SetOutcome score(const SetDesign& design, const StudySet& set, const Calibration& calibration) {
  SetOutcome outcome;
  static_cast<Claims&>(outcome) = check_claims(design, set, calibration.diagnosis);
  outcome.design = design;
  outcome.feasible = set.feasible;
  outcome.truth = describe_truth(set.effects);
  outcome.size = set.size;
  outcome.sigma = set.sigma;
  outcome.verdict = calibration.diagnosis.verdict;
  outcome.p_value = calibration.diagnosis.p_value;
  for (const FoundEffect& effect : calibration.diagnosis.effects)
    outcome.heldout_gain = std::max(outcome.heldout_gain, effect.heldout_gain);
  for (const UnlistedStructure& found : calibration.diagnosis.unlisted)
    outcome.heldout_gain = std::max(outcome.heldout_gain, found.heldout_gain);

  check_parameters(set.effects, calibration.diagnosis, outcome);
  check_twelve(set, calibration, outcome);
  score_oracle(set, outcome);
  const CertifiedModel model = certified_model(calibration);
  const Told told = told_effects(design, set);
  outcome.told_fresh = told.fresh_mps2;
  outcome.truth_ahead = criterion_of(set, calibration) - told.criterion;
  outcome.before.heldout = over_axes(calibration.before.heldout_pose_rms_mps2);
  outcome.after.heldout = over_axes(calibration.after.heldout_pose_rms_mps2);
  score_fresh(set, model, outcome);
  outcome.evaluated_fresh =
      over_axes(evaluate(model, set.set.verification, set.set.description).after.pose_rms_mps2);
  return outcome;
}

SetOutcome run_set(const SetDesign& design) {
  const StudySet set = make_set(design);
  if (!set.feasible) {
    SetOutcome outcome;
    outcome.design = design;
    outcome.feasible = false;
    outcome.truth = describe_truth(set.effects);
    outcome.size = set.size;
    outcome.sigma = set.sigma;
    outcome.effects = static_cast<int>(set.effects.size());
    return outcome;
  }
  const auto start = std::chrono::steady_clock::now();
  const Calibration calibration =
      calibrate({set.set.run, &set.static_record, set.set.description}, {design.seed});
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  SetOutcome outcome = score(design, set, calibration);
  outcome.seconds = seconds;
  const NaiveResult naive = search_naively(set);
  outcome.naive = check_claims(design, set, naive.diagnosis);
  outcome.naive_fresh = naive.fresh_mps2;
  return outcome;
}

}  // namespace plumbline::study
