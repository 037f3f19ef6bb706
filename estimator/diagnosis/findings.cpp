#include "estimator/diagnosis/findings.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/separating_design.h"
#include "estimator/diagnosis/structure_parts.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

/// An instant lies somewhere between the last sample before it and the first one after, or in a
/// part of a dwell.
void place(const VisitLog& log, EffectParameter& instant) {
  const auto after = std::find_if(log.visits.begin(), log.visits.end(), [&](const Visit& visit) {
    return visit.t_arrival_s >= instant.value;
  });
  if (after == log.visits.begin()) return;
  const Visit& before = *std::prev(after);
  const auto count = static_cast<double>(before.count);
  const double end_s = before.t_arrival_s + before.step_s * (count - 1);
  const bool nothing_after = after == log.visits.end();
  if (instant.value <= end_s || nothing_after) {
    instant.u = before.step_s * count / (effect::kPartsOfDwell * std::sqrt(12.0));
    return;
  }
  instant.value = 0.5 * (end_s + after->t_arrival_s);
  instant.u = (after->t_arrival_s - end_s) / std::sqrt(12.0);
}

std::vector<EffectParameter> report_parameters(const VisitLog& log,
                                               const EnlargedEstimate& estimate,
                                               std::size_t effect) {
  Eigen::Index row = estimate.parameters.first_free(effect);
  const ActiveEffect& active = estimate.parameters.effects[effect];
  const auto infos = active.effect->parameters();
  std::vector<double> values = active.p;
  active.effect->normalise(values);
  std::vector<EffectParameter> reported;
  for (std::size_t k = 0; k < infos.size(); ++k) {
    // An amplitude that this hypothesis leaves out is no result.
    if (infos[k].role == ParameterRole::amplitude && !active.free[k]) continue;
    EffectParameter parameter{infos[k].name, std::nullopt, values[k], 0, infos[k].unit};
    parameter.unrecorded = infos[k].unrecorded;
    const double by_range = active.effect->choice_uncertainty(log, active.axis, active.p, k);
    parameter.u = by_range;
    if (active.free[k]) {
      parameter.estimated = true;
      parameter.u = std::sqrt(std::max(estimate.covariance(row, row), 0.0));
      // Where the response does not change, what its slope says has no limit.
      if (by_range > 0) parameter.u = std::min(parameter.u, by_range);
      ++row;
    }
    if (active.effect->subject() == Subject::sensor) parameter.axis = active.axis;
    if (infos[k].instant) place(log, parameter);
    reported.push_back(std::move(parameter));
  }
  return reported;
}

void add_name(const std::string& name, Ambiguity& entry) {
  auto& names = entry.alternatives;
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

void add_rivals(const Rivals& rivals, Ambiguity& entry) {
  for (const Alternative& rival : rivals.alternatives) add_name(rival.name, entry);
  const Separation& separation = rivals.separation;
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
    if (p.unrecorded) continue;
    text += (k == 0 ? "" : ", ") + p.name + " = " + number(p.value, "%.4g");
    if (p.u > 0) text += " ± " + number(p.u, "%.2g");
    if (!p.unit.empty()) text += " " + p.unit;
  }
  return text;
}

std::string describe(const UnlistedStructure& structure) {
  if (structure.is_wandering()) return "unlisted: the bias wanders beyond the static record";
  if (structure.is_of_noise())
    return "unlisted: the noise follows " + structure.driver + " (" + structure.shape + ")";
  std::string text =
      "unlisted: " + structure.driver + " changes the " + structure.form + " (" + structure.shape;
  for (const EffectParameter& p : structure.parameters)
    if (p.name == "tau") text += ", time constant " + number(p.value, "%.3g") + " s";
  return text + ")";
}

/// The same weakness of several axes is one effect with several axes, and so are several poses that
/// went wrong each by itself.
bool shares_an_entry(const Effect& effect) {
  return effect.subject() == Subject::sensor || effect.concerns_one_visit();
}

/// Where an effect of the model is reported: at which place of which list.
struct Place {
  bool unlisted = false;
  std::size_t index = 0;
};

/// Of each effect of a model, in its order. A column that changes the bias of one axis and the
/// scale of another is two effects under one id.
std::vector<Place> places_of(const EnlargedParameters& model) {
  const std::vector<ActiveEffect>& effects = model.effects;
  std::vector<Place> places;
  std::size_t listed = 0, unlisted = 0;
  for (const ActiveEffect& active : effects) {
    const bool is_unlisted = structure_name(active).has_value();
    const bool has_listed_shape = !is_unlisted || active.part_of;
    const auto same = std::find_if(effects.begin(), effects.end(),
                                   [&](const ActiveEffect& other) {
                                     return other.effect == active.effect &&
                                            other.part_of.has_value() == active.part_of.has_value();
                                   }) -
                      effects.begin();
    const bool joins =
        has_listed_shape && shares_an_entry(*active.effect) && same < std::ssize(places);
    if (joins)
      places.push_back(places[static_cast<std::size_t>(same)]);
    else
      places.push_back({is_unlisted, is_unlisted ? unlisted++ : listed++});
  }
  return places;
}

/// One entry per place.
struct Reported {
  std::vector<FoundEffect> effects;
  std::vector<UnlistedStructure> unlisted;
};

/// The axes of an effect, and its parameters, to the entry that it has or shares.
template <typename Entry>
void add_to(Entry& entry, const ActiveEffect& active, std::vector<EffectParameter> parameters) {
  for (const std::size_t axis : axes_of(active))
    if (std::find(entry.axes.begin(), entry.axes.end(), axis) == entry.axes.end())
      entry.axes.push_back(axis);
  std::sort(entry.axes.begin(), entry.axes.end());
  std::move(parameters.begin(), parameters.end(), std::back_inserter(entry.parameters));
}

Reported report(const VisitLog& log, const EnlargedEstimate& estimate) {
  Reported reported;
  const std::vector<Place> places = places_of(estimate.parameters);
  for (std::size_t e = 0; e < places.size(); ++e) {
    const ActiveEffect& active = estimate.parameters.effects[e];
    std::vector<EffectParameter> parameters = report_parameters(log, estimate, e);
    if (const auto name = structure_name(active)) {
      if (places[e].index == reported.unlisted.size()) {
        UnlistedStructure fresh;
        fresh.driver = name->driver;
        fresh.form = name->form;
        fresh.shape = name->shape;
        fresh.p_value = 0;
        reported.unlisted.push_back(std::move(fresh));
      }
      add_to(reported.unlisted[places[e].index], active, std::move(parameters));
      continue;
    }
    if (places[e].index == reported.effects.size()) {
      FoundEffect fresh;
      fresh.id = active.effect->id();
      fresh.p_value = 0;
      fresh.definition = active.effect->definition();
      reported.effects.push_back(std::move(fresh));
    }
    add_to(reported.effects[places[e].index], active, std::move(parameters));
  }
  return reported;
}

void attach(const std::vector<EffectParameter>& batch, const std::vector<EffectParameter>& filtered,
            std::vector<EffectParameter>& reported) {
  for (std::size_t k = 0; k < reported.size(); ++k) {
    if (!reported[k].estimated) continue;
    const double value = filtered[k].value, u = filtered[k].u, u_batch = batch[k].u;
    const double difference = std::abs(value - reported[k].value);
    const double beyond2 = std::max(0.0, reported[k].u * reported[k].u - u_batch * u_batch);
    reported[k].filter = {value, std::sqrt(u * u + beyond2),
                          difference / (2 * std::hypot(u, u_batch))};
  }
}

/// In the place of a name, structures count where some poses would tell them from it: what does the
/// same wherever the head goes is the same, said with more words.
void keep_what_poses_tell(const SearchInput& input, const SearchResult& search,
                          const HeadReach& reach, std::vector<Alternative>& alternatives) {
  const auto first = std::stable_partition(alternatives.begin(), alternatives.end(),
                                           [](const Alternative& each) { return each.has_name; });
  std::vector<Alternative> structures(std::make_move_iterator(first),
                                      std::make_move_iterator(alternatives.end()));
  alternatives.erase(first, alternatives.end());
  if (structures.empty()) return;
  const std::vector<double> most = best_proposal(input, search, structures, reach).most;
  for (std::size_t k = 0; k < structures.size(); ++k)
    if (most[k] >= kDecided) alternatives.push_back(std::move(structures[k]));
}

}  // namespace

std::vector<Rivals> find_rivals(const SearchInput& input, const CandidateList& list,
                                const SearchResult& search, const HeadReach& reach) {
  std::vector<Rivals> rivals(search.evidence.size());
  parallel_for(rivals.size(), [&](std::size_t e) {
    rivals[e].alternatives = find_alternatives(input, list, search, e);
    if (search.evidence[e].candidate.has_name())
      keep_what_poses_tell(input, search, reach, rivals[e].alternatives);
    rivals[e].separation = separate(input, search, e, rivals[e].alternatives, reach);
  });
  return rivals;
}

Diagnosis describe_findings(const SearchInput& input, const CandidateList& list,
                            const SearchResult& search, const std::vector<Rivals>& rivals) {
  Diagnosis diagnosis;
  auto [effects, unlisted] = report(input.log, search.fit);
  diagnosis.not_found = detection_limits(input, list, search);
  const std::vector<ActiveEffect>& model = search.fit.parameters.effects;
  const std::vector<Place> places = places_of(search.fit.parameters);
  for (std::size_t e = 0; e < places.size(); ++e) {
    const auto complete = [&](auto& entry) {
      entry.p_value = std::max(entry.p_value, search.evidence[e].p_value);
      // It may be what its name says after all.
      if (model[e].part_of) add_name(model[e].effect->id(), entry);
      add_rivals(rivals[e], entry);
    };
    if (places[e].unlisted)
      complete(unlisted[places[e].index]);
    else
      complete(effects[places[e].index]);
  }
  diagnosis.effects = std::move(effects);
  diagnosis.unlisted = std::move(unlisted);
  diagnosis.p_value =
      search.evidence.empty() ? search.p_best_rest : search.evidence.front().p_value;
  if (search.evidence.empty()) {
    diagnosis.verdict = Verdict::clean;
    diagnosis.reason = "no effect stands out of the identified noise";
    return diagnosis;
  }
  diagnosis.verdict = Verdict::explained;
  for (const FoundEffect& effect : diagnosis.effects) {
    diagnosis.reason += (diagnosis.reason.empty() ? "" : "; ") + describe(effect);
  }
  for (const UnlistedStructure& structure : diagnosis.unlisted) {
    diagnosis.reason += (diagnosis.reason.empty() ? "" : "; ");
    diagnosis.reason += describe(structure);
  }
  return diagnosis;
}

void attach_filter(const VisitLog& log, const EnlargedEstimate& batch,
                   const EnlargedEstimate& filter, Diagnosis& diagnosis) {
  const Reported by_batch = report(log, batch), filtered = report(log, filter);
  for (std::size_t k = 0; k < filtered.effects.size(); ++k)
    attach(by_batch.effects[k].parameters, filtered.effects[k].parameters,
           diagnosis.effects[k].parameters);
  for (std::size_t k = 0; k < filtered.unlisted.size(); ++k)
    attach(by_batch.unlisted[k].parameters, filtered.unlisted[k].parameters,
           diagnosis.unlisted[k].parameters);
}

namespace {

/// Whether something in the model makes readings of an axis scatter more or less than the noise.
bool changes_scatter(const EnlargedParameters& model, std::size_t axis) {
  return std::any_of(model.effects.begin(), model.effects.end(), [&](const ActiveEffect& active) {
    const Effect& effect = *active.effect;
    const std::vector<std::size_t> axes = axes_of(active);
    return std::find(axes.begin(), axes.end(), axis) != axes.end() &&
           (effect.within_dwell() || effect.at_converter() || effect.quiets());
  });
}

}  // namespace

void add_noise(const std::vector<NoiseDriver>& follows, const EnlargedParameters& model,
               Diagnosis& diagnosis) {
  for (const NoiseDriver& each : follows) {
    if (!each.at_random && changes_scatter(model, each.axis)) continue;
    const auto like_it = std::find_if(
        diagnosis.unlisted.begin(), diagnosis.unlisted.end(), [&](const UnlistedStructure& other) {
          return other.driver == each.driver && other.shape == each.shape;
        });
    EffectParameter ratio{"ratio", each.axis, each.ratio, each.u_ratio, ""};
    if (like_it != diagnosis.unlisted.end()) {
      like_it->axes.push_back(each.axis);
      like_it->parameters.push_back(std::move(ratio));
      like_it->p_value = std::max(like_it->p_value, each.p_value);
      like_it->heldout_gain = std::max(like_it->heldout_gain, each.heldout_gain);
      like_it->sigmas = std::max(like_it->sigmas, each.sigmas);
      continue;
    }
    diagnosis.unlisted.push_back({{},
                                  each.driver,
                                  to_string(each.at_random ? TermForm::bias : TermForm::sample),
                                  {each.axis},
                                  each.shape,
                                  {std::move(ratio)},
                                  each.p_value,
                                  each.heldout_gain,
                                  each.sigmas});
    diagnosis.reason += "; " + describe(diagnosis.unlisted.back());
    if (diagnosis.verdict == Verdict::clean) diagnosis.p_value = each.p_value;
    if (each.at_random)
      diagnosis.verdict = Verdict::partly_explained;
    else if (diagnosis.verdict == Verdict::clean)
      diagnosis.verdict = Verdict::explained;
  }
}

void attach_gains(const SearchResult& found, const std::vector<double>& gains,
                  Diagnosis& diagnosis) {
  const std::vector<Place> places = places_of(found.fit.parameters);
  for (std::size_t e = 0; e < places.size() && e < gains.size(); ++e) {
    const auto attach = [&](auto& entry) {
      entry.heldout_gain = std::max(entry.heldout_gain, gains[e]);
      entry.sigmas = std::max(entry.sigmas, found.evidence[e].sigmas);
    };
    if (places[e].unlisted)
      attach(diagnosis.unlisted[places[e].index]);
    else
      attach(diagnosis.effects[places[e].index]);
  }
}

}  // namespace plumbline
