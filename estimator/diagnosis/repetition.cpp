#include "estimator/diagnosis/repetition.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include "estimator/diagnosis/edge_comb.h"
#include "estimator/diagnosis/screening.h"

namespace plumbline {

namespace {

bool has_amplitude(const Effect& effect) {
  const auto infos = effect.parameters();
  return std::any_of(infos.begin(), infos.end(), [](const ParameterInfo& info) {
    return info.role == ParameterRole::amplitude;
  });
}

/// Of one effect those that gain most beside a fit to first order, best first. Without an amplitude
/// none makes up for being the wrong one: then one of each kind, which the first parameter tells.
std::vector<Candidate> likeliest(const SearchModel& model, const CandidateList& list,
                                 const EnlargedFit& fit) {
  constexpr std::size_t kFew = 8, kMostKinds = 12;
  constexpr double kSameKind = 0.02;
  if (list.candidates.size() <= kFew) return list.candidates;
  const CandidateResponses beside =
      candidate_responses(model.input().log, list, model.stage().whitening, fit.parameters);
  const CandidateGains gains_of(beside, fit);
  const bool free_size = has_amplitude(*list.candidates.front().effect);
  const Eigen::VectorXd gains =
      free_size ? gains_of.of_residual() : gains_of.of_residual_as_they_stand();
  std::vector<std::size_t> order(list.candidates.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t k, std::size_t l) {
    return gains(static_cast<Eigen::Index>(k)) > gains(static_cast<Eigen::Index>(l));
  });
  std::vector<Candidate> few;
  for (const std::size_t k : order) {
    const Candidate& next = list.candidates[k];
    const bool is_known = !free_size && std::any_of(few.begin(), few.end(), [&](const auto& c) {
      return std::abs(c.hypothesis.p[0] / next.hypothesis.p[0] - 1) < kSameKind;
    });
    if (!is_known) few.push_back(next);
    if (few.size() == (free_size ? kFew : kMostKinds)) break;
  }
  return few;
}

/// The candidate of the list that is of the same family: from `first` on, the first of its effect.
std::size_t like_it(const CandidateList& list, std::size_t first, const Candidate& one) {
  const auto is_free = [](const Candidate& candidate) { return candidate.active().free; };
  for (std::size_t c = first;
       c < list.candidates.size() && list.candidates[c].effect == one.effect &&
       list.candidates[c].axis == one.axis;
       ++c)
    if (is_free(list.candidates[c]) == is_free(one)) return c;
  return first;
}

/// One candidate in the place of the `instances` of the candidate `repeated`, whose parameters
/// are `p`; of all that could be one, so many were looked at; noise may do as well so often.
bool replace_in_one(SearchModel& model, const std::vector<std::size_t>& instances,
                    const Candidate& repeated, const std::vector<std::vector<double>>& p,
                    double looks, double false_alarm) {
  std::optional<EnlargedFit> without;  // most findings hint at nothing
  const Effect* tried = nullptr;
  std::optional<SearchModel::Entry> best;
  // Several effects of one name are no likelier than as many names.
  const auto further = static_cast<double>(std::max<std::ptrdiff_t>(std::ssize(instances), 1) - 1);
  const double of_name = repeated.has_name() ? kOfForty * further : 0;
  double best_cost = model.stage().fit.chi2 + model.price_of(instances) + of_name;
  for (std::size_t c = 0; c < model.list().candidates.size(); ++c) {
    const Candidate& candidate = model.list().candidates[c];
    if (candidate.axis != repeated.axis || candidate.effect == tried) continue;
    if (model.is_chosen_beside(instances, candidate)) continue;
    tried = candidate.effect;
    CandidateList ones;
    for (const Hypothesis& hypothesis :
         tried->in_one(model.input().log, candidate.axis, *repeated.effect, p))
      ones.candidates.push_back(
          {.effect = tried, .axis = candidate.axis, .hypothesis = hypothesis});
    if (ones.candidates.empty()) continue;
    if (!without) without = model.fit_without(instances);
    if (!without->determined) return false;
    for (const Candidate& one : likeliest(model, ones, *without)) {
      const ActiveEffect active = one.active();
      const EnlargedFit with = model.fit_with(without->parameters, active);
      const auto dof = static_cast<int>(active.free_count());
      const std::size_t alike = like_it(model.list(), c, one);
      const double cost = with.chi2 + model.price(alike);
      if (!with.determined || cost >= best_cost) continue;
      const double p_value = p_of_search(
          log_chi_squared_tail(without->chi2 - with.chi2, static_cast<double>(dof)), looks);
      if (p_value > false_alarm) continue;
      best_cost = cost;
      best = {alike, p_value, with.parameters};
    }
  }
  return best && model.exchange(instances, *best);
}

bool is_step(const Candidate& candidate) { return candidate.effect->id() == "sensor.bias_step"; }
/// What the model holds of an axis that steps: steps one by one, and trains of them.
std::vector<std::size_t> of_regular_steps(const SearchModel& model, std::size_t axis) {
  const std::vector<std::vector<double>> any_train = {{1, 0}, {1, 1}, {-1, 0.5}};
  const auto& candidates = model.list().candidates;
  const auto step = std::find_if(candidates.begin(), candidates.end(), is_step);
  if (step == candidates.end()) return {};
  std::vector<std::size_t> found;
  for (std::size_t k = 0; k < model.size(); ++k) {
    const Candidate& chosen = model.candidate(k);
    if (chosen.axis == axis &&
        (is_step(chosen) ||
         !chosen.effect->in_one(model.input().log, axis, *step->effect, any_train).empty()))
      found.push_back(k);
  }
  return found;
}
/// Whether the readings of an axis hang on where its codes change.
bool has_edges(const SearchModel& model, std::size_t axis) {
  return model.stage().coarse[axis] || model.stage().crossing_V2[axis].size() > 0 ||
         !model.input().log.codes[axis].stuck_bits.empty();
}
bool put_train_in_place_of(SearchModel& model, const std::vector<std::size_t>& instances,
                           std::size_t axis) {
  constexpr double kMayGain = 1.3;  // by which a train may gain more when its edges move
  const SearchOptions& options = model.options();
  const double false_alarm =
      has_edges(model, axis) ? options.false_alarm_of_train_at_edges : options.false_alarm;
  const EnlargedFit without = model.fit_without(instances);
  if (!without.determined) return false;
  const auto comb = regular_steps(model.list(), model.responses(), without, axis);
  if (!comb) return false;
  const double looks = static_cast<double>(kAxisCount) * comb->looks;
  if (p_of_search(log_chi_squared_tail(kMayGain * comb->gain, 1), looks) > false_alarm)
    return false;
  const double size = comb->size, up_s = comb->first_up_s;
  return replace_in_one(
      model, instances, model.list().candidates[comb->first_step],
      {{size, up_s}, {size, up_s + comb->period_s}, {-size, up_s + comb->width_s}}, looks,
      false_alarm);
}

/// Whether something was told in one.
bool told_one(SearchModel& model) {
  for (std::size_t k = 0; k < model.size(); ++k) {
    const Candidate& first = model.candidate(k);
    if (is_step(first)) {
      const std::vector<std::size_t> steps = of_regular_steps(model, first.axis);
      const auto first_step = std::find_if(
          steps.begin(), steps.end(), [&](std::size_t l) { return is_step(model.candidate(l)); });
      // A train of which the run saw one pulse is still to be told.
      if (k == *first_step && steps.size() > 1 && put_train_in_place_of(model, steps, first.axis))
        return true;
    }
    std::vector<std::size_t> instances;
    std::vector<std::vector<double>> p;
    for (std::size_t l = 0; l < model.size(); ++l) {
      const Candidate& other = model.candidate(l);
      if (other.effect != first.effect || other.axis != first.axis) continue;
      instances.push_back(l);
      p.push_back(model.stage().fit.parameters.effects[l].p);
    }
    if (instances.front() < k) continue;  // looked at with the first of them
    if (replace_in_one(model, instances, first, p, model.looks(), model.options().false_alarm))
      return true;
  }
  return false;
}

}  // namespace

void tell_in_one(SearchModel& model) {
  constexpr int kMost = 8;  // noise that is estimated anew might lead there and back
  for (int told = 0; told < kMost && told_one(model); ++told) {
  }
}

bool add_train(SearchModel& model) {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const std::vector<std::size_t> found = of_regular_steps(model, axis);
    if (put_train_in_place_of(model, found, axis)) return true;
    // What stepped by itself may stay beside it, another train not.
    if (!found.empty() &&
        std::all_of(found.begin(), found.end(),
                    [&](std::size_t k) { return is_step(model.candidate(k)); }) &&
        put_train_in_place_of(model, {}, axis))
      return true;
  }
  return false;
}

}  // namespace plumbline
