#include "estimator/diagnosis/diagnose.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "estimator/diagnosis/alternatives.h"
#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/separation.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {
namespace {

// Standard uncertainties of one active effect's parameters; indices have none.
std::vector<double> uncertainties(const EnlargedFit& fit, std::size_t effect) {
  Eigen::Index row = 4 * static_cast<Eigen::Index>(kAxisCount);
  for (std::size_t e = 0; e < effect; ++e) {
    const auto& free = fit.parameters.effects[e].free;
    row += std::count(free.begin(), free.end(), true);
  }
  const ActiveEffect& active = fit.parameters.effects[effect];
  std::vector<double> u(active.p.size(), 0);
  for (std::size_t k = 0; k < u.size(); ++k) {
    if (active.free[k]) {
      u[k] = std::sqrt(fit.covariance(row, row));
      ++row;
    }
  }
  return u;
}

std::vector<EffectParameter> report_parameters(const VisitLog& log, const EnlargedFit& fit,
                                               std::size_t effect) {
  const ActiveEffect& active = fit.parameters.effects[effect];
  const auto infos = active.effect->parameters();
  const std::vector<double> u = uncertainties(fit, effect);
  std::vector<double> values = active.p;
  active.effect->normalise(values);
  std::vector<EffectParameter> reported;
  for (std::size_t k = 0; k < infos.size(); ++k) {
    // An amplitude that this hypothesis leaves out is no result.
    if (infos[k].role == ParameterRole::amplitude && !active.free[k]) continue;
    EffectParameter parameter{infos[k].name, std::nullopt, values[k], u[k], infos[k].unit};
    if (active.effect->subject() == Subject::sensor) parameter.axis = active.axis;
    if (infos[k].role == ParameterRole::index && infos[k].unit == "s") {
      // The instant lies somewhere between the last sample before and the first one after.
      for (std::size_t v = 1; v < log.visits.size(); ++v) {
        if (log.visits[v].t_arrival_s != active.p[k]) continue;
        const Visit& before = log.visits[v - 1];
        const double end_s =
            before.t_arrival_s + before.step_s * (static_cast<double>(before.count) - 1);
        parameter.value = 0.5 * (end_s + active.p[k]);
        parameter.u = (active.p[k] - end_s) / std::sqrt(12.0);
      }
    }
    reported.push_back(std::move(parameter));
  }
  return reported;
}

/// What else effect `index` could be, and what would tell.
void add_rivals(const SearchInput& input, const Diagnosed& diagnosed,
                const CandidateResponses& responses, std::size_t index, FoundEffect& entry) {
  const std::vector<Alternative> rivals =
      find_alternatives(input, diagnosed.candidates, responses, diagnosed.search, index);
  for (const Alternative& rival : rivals) {
    auto& names = entry.alternatives;
    if (std::find(names.begin(), names.end(), rival.name) == names.end())
      names.push_back(rival.name);
  }
  const Separation separation = separate(input, diagnosed.search, index, rivals, diagnosed.reach);
  if (separation.words.empty() || entry.separate_by == separation.words) return;
  entry.separate_by += (entry.separate_by.empty() ? "" : "; ") + separation.words;
  // Further axes of the same effect rarely need other poses: the longest plan serves.
  if (separation.plan.stops.size() > entry.separating_plan.stops.size())
    entry.separating_plan = separation.plan;
}

std::string number(double value, const char* format) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string describe(const FoundEffect& effect) {
  std::string text = effect.id + " (";
  for (std::size_t axis : effect.axes)
    text += std::string(axis == effect.axes.front() ? "" : ", ") + kAxisName[axis];
  text += "): ";
  for (std::size_t k = 0; k < effect.parameters.size(); ++k) {
    const EffectParameter& p = effect.parameters[k];
    text += (k == 0 ? "" : ", ") + p.name + " = " + number(p.value, "%.4g");
    if (p.u > 0) text += " ± " + number(p.u, "%.2g");
    if (!p.unit.empty()) text += " " + p.unit;
  }
  return text;
}

/// The same weakness of several axes is one effect with several axes, and so are several poses that
/// went wrong each by itself.
bool shares_an_entry(const Effect& effect) {
  return effect.subject() == Subject::sensor || effect.concerns_one_visit();
}

/// One entry per id, axes and parameters together.
std::vector<FoundEffect> report_effects(const VisitLog& log, const EnlargedFit& fit) {
  std::vector<FoundEffect> found;
  for (std::size_t e = 0; e < fit.parameters.effects.size(); ++e) {
    const ActiveEffect& active = fit.parameters.effects[e];
    const std::string id = active.effect->id();
    auto entry = found.end();
    if (shares_an_entry(*active.effect)) {
      entry = std::find_if(found.begin(), found.end(),
                           [&](const FoundEffect& f) { return f.id == id; });
    }
    if (entry == found.end()) {
      FoundEffect fresh;
      fresh.id = id;
      fresh.p_value = 0;
      fresh.definition = active.effect->definition();
      entry = found.insert(found.end(), std::move(fresh));
    }
    for (std::size_t axis : axes_of(active)) {
      if (std::find(entry->axes.begin(), entry->axes.end(), axis) == entry->axes.end()) {
        entry->axes.push_back(axis);
      }
    }
    std::sort(entry->axes.begin(), entry->axes.end());
    for (EffectParameter& p : report_parameters(log, fit, e))
      entry->parameters.push_back(std::move(p));
  }
  return found;
}

}  // namespace

void describe_findings(const SearchInput& input, Diagnosed& diagnosed) {
  const SearchResult& search = diagnosed.search;
  Diagnosis& diagnosis = diagnosed.diagnosis;
  diagnosis = {};
  std::vector<FoundEffect> found = report_effects(input.log, search.fit);
  const CandidateResponses responses =
      candidate_responses(input.log, diagnosed.candidates, search.whitening, search.fit.parameters);
  diagnosis.not_found = detection_limits(input, diagnosed.candidates, responses, search);
  for (std::size_t e = 0; e < search.evidence.size(); ++e) {
    const Effect& effect = *search.evidence[e].candidate.effect;
    const std::string id = effect.id();
    if (const auto* term = dynamic_cast<const SmoothTerm*>(&effect)) {
      diagnosis.unlisted.push_back({term->driver(), to_string(term->form()),
                                    axes_of(search.fit.parameters.effects[e]), term->shape(),
                                    report_parameters(input.log, search.fit, e),
                                    search.evidence[e].p_value, 0});
      continue;
    }
    for (FoundEffect& entry : found) {
      if (entry.id != id) continue;
      entry.p_value = std::max(entry.p_value, search.evidence[e].p_value);
      if (!effect.certain()) add_rivals(input, diagnosed, responses, e, entry);
    }
  }
  std::erase_if(found, [](const FoundEffect& f) { return f.id.starts_with("unlisted:"); });
  diagnosis.effects = std::move(found);
  diagnosis.p_value =
      search.evidence.empty() ? search.p_best_rest : search.evidence.front().p_value;
  if (diagnosis.effects.empty() && diagnosis.unlisted.empty()) {
    diagnosis.verdict = Verdict::clean;
    diagnosis.reason = "no effect stands out of the identified noise";
    return;
  }
  diagnosis.verdict = Verdict::explained;
  for (const FoundEffect& effect : diagnosis.effects) {
    diagnosis.reason += (diagnosis.reason.empty() ? "" : "; ") + describe(effect);
  }
  for (const UnlistedStructure& unlisted : diagnosis.unlisted) {
    diagnosis.reason += (diagnosis.reason.empty() ? "" : "; ");
    diagnosis.reason += "unlisted: a " + unlisted.shape + " in " + unlisted.driver +
                        " changes the " + unlisted.form;
  }
}

void attach_filter(Diagnosed& diagnosed, const Eigen::VectorXd& value, const Eigen::VectorXd& u) {
  Diagnosis& diagnosis = diagnosed.diagnosis;
  std::vector<std::size_t> next(diagnosis.effects.size(), 0);  // parameter of each entry
  std::size_t unlisted = 0;
  Eigen::Index row = 0;
  for (const ActiveEffect& active : diagnosed.search.fit.parameters.effects) {
    const Effect& effect = *active.effect;
    std::vector<EffectParameter>* reported = nullptr;
    std::size_t own = 0;
    std::size_t* at = &own;
    if (dynamic_cast<const SmoothTerm*>(&effect) != nullptr) {
      reported = &diagnosis.unlisted[unlisted++].parameters;
    } else {
      for (std::size_t k = 0; k < diagnosis.effects.size() && reported == nullptr; ++k) {
        if (diagnosis.effects[k].id != effect.id()) continue;
        if (!shares_an_entry(effect) && next[k] > 0) continue;  // that of another one
        reported = &diagnosis.effects[k].parameters;
        at = &next[k];
      }
    }
    // As report_parameters() lists them.
    const auto infos = effect.parameters();
    std::vector<double> values = active.p, own_u(active.p.size(), 0);
    for (std::size_t k = 0; k < infos.size(); ++k) {
      if (!active.free[k]) continue;
      values[k] = value(row);
      own_u[k] = u(row++);
    }
    effect.normalise(values);
    for (std::size_t k = 0; k < infos.size(); ++k) {
      if (infos[k].role == ParameterRole::amplitude && !active.free[k]) continue;
      EffectParameter& parameter = reported->at((*at)++);
      if (!active.free[k]) continue;
      const double difference = std::abs(values[k] - parameter.value);
      parameter.filter = {values[k], own_u[k],
                          difference / (2 * std::hypot(own_u[k], parameter.u))};
    }
  }
}

void attach_gains(Diagnosed& diagnosed, const std::vector<double>& gains) {
  Diagnosis& diagnosis = diagnosed.diagnosis;
  std::size_t unlisted = 0;
  for (std::size_t e = 0; e < diagnosed.search.evidence.size() && e < gains.size(); ++e) {
    const Effect& effect = *diagnosed.search.evidence[e].candidate.effect;
    if (dynamic_cast<const SmoothTerm*>(&effect) != nullptr) {
      diagnosis.unlisted[unlisted++].heldout_gain = gains[e];
      continue;
    }
    for (FoundEffect& entry : diagnosis.effects) {
      if (entry.id == effect.id()) entry.heldout_gain = std::max(entry.heldout_gain, gains[e]);
    }
  }
}

Diagnosed diagnose(const SearchInput& input, const SearchOptions& options,
                   const CalibrationOptions& calibration) {
  Diagnosed diagnosed;
  diagnosed.reach = calibration.reach.value_or(reach_of(input.log));
  diagnosed.candidates = all_candidates(input.log);
  for (const auto& effect : calibration.own_effects) {
    diagnosed.candidates.owned.push_back(effect);
    add_candidates(diagnosed.candidates, input.log, *effect);
  }
  diagnosed.search = search_effects(input, diagnosed.candidates, options);
  describe_findings(input, diagnosed);
  return diagnosed;
}

}  // namespace plumbline
