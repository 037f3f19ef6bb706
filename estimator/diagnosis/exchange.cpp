#include "estimator/diagnosis/exchange.h"

#include <algorithm>
#include <vector>

#include "estimator/diagnosis/screening.h"
#include "estimator/diagnosis/slow_look.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

/// What is worth its price in the place of a subset, likeliest first.
std::vector<SearchModel::Entry> exchanges_for(const SearchModel& model,
                                              const CandidateResponses& responses,
                                              const std::vector<std::size_t>& subset) {
  constexpr std::size_t kMostRefined = 4;
  constexpr double kClearly = 2;
  std::vector<SearchModel::Entry> exchanges;
  const EnlargedFit without = model.fit_without(subset);
  if (!without.determined) return exchanges;
  const double spent = model.price_of(subset);
  const CandidateGains gains(responses, without);
  const std::vector<Scored> ranked =
      screen(model.list(), gains, gains.of(without.whitened_residual).col(0));
  for (std::size_t r = 0; r < std::min(kMostRefined, ranked.size()); ++r) {
    const std::size_t index = ranked[r].candidate;
    const Candidate& candidate = model.list().candidates[index];
    const Candidate& replaced = model.candidate(subset.front());
    if (subset.size() == 1 && candidate.family == replaced.family &&
        candidate.hypothesis.p == replaced.hypothesis.p)
      continue;
    if (model.is_chosen_beside(subset, candidate)) continue;
    const EnlargedFit with = model.fit_with(without.parameters, candidate.active());
    if (!with.determined) continue;
    const double cost = with.chi2 + model.price(index);
    if (!(cost < model.stage().fit.chi2 + spent - kClearly)) continue;
    const double p =
        model.p_of(model.log_p_of(index, without.chi2 - with.chi2, gains.dof(index), with));
    if (p <= model.options().false_alarm) exchanges.push_back({index, p, with.parameters});
  }
  return exchanges;
}

}  // namespace

bool exchange_one(SearchModel& model) {
  std::vector<std::vector<std::size_t>> subsets;
  for (std::size_t k = 0; k < model.size(); ++k) subsets.push_back({k});
  for (std::size_t k = 0; k < model.size(); ++k)
    for (std::size_t l = k + 1; l < model.size(); ++l) subsets.push_back({k, l});
  std::erase_if(subsets, [&](const std::vector<std::size_t>& subset) {
    return std::any_of(subset.begin(), subset.end(),
                       [&](std::size_t k) { return model.is_certain(model.candidate(k)); });
  });
  const CandidateResponses& responses = model.responses();
  std::vector<std::vector<SearchModel::Entry>> exchanges(subsets.size());
  parallel_for(subsets.size(),
               [&](std::size_t s) { exchanges[s] = exchanges_for(model, responses, subsets[s]); });
  for (std::size_t s = 0; s < subsets.size(); ++s) {
    for (const SearchModel::Entry& with : exchanges[s])
      if (model.exchange(subsets[s], with)) return true;
  }
  return false;
}

bool exchange_slow(SearchModel& model, std::size_t k) {
  constexpr double kClearly = 2;
  const Candidate& chosen = model.candidate(k);
  const std::size_t axis = chosen.axis;
  if (model.is_certain(chosen) || chosen.effect->subject() == Subject::head ||
      !has_slow_noise(model.input(), model.stage(), axis))
    return false;
  const Eigen::MatrixXd beside = any_course_of_time(model.input().log);
  if (!is_slow(model.input(), model.stage().fit.parameters, k, beside)) return false;
  const EnlargedFit without = model.fit_without({k});
  if (!without.determined) return false;
  const Stage stage = settle(model.input(), without.parameters, {.start = &model.stage().noise});
  PerAxis<bool> axes{};
  axes[axis] = true;
  const auto is_open = [&](const Candidate& c) {
    return c.effect == chosen.effect || !model.is_chosen(c);
  };
  const auto found = look_among_slow(model.input(), model.list(), stage, true,
                                     {beside, axes, 1, model.false_alarm_of_slow(), is_open});
  if (!found || !found->significant || found->candidate == model.index(k)) return false;
  const auto cost = [&](const EnlargedParameters& with, std::size_t candidate) {
    Before before{.known = all_of(stage.noise), .start = &stage.noise, .freed = &stage};
    before.known[axis] = nullptr;
    const Stage stage_with = settle_noise(model.input(), with, before);
    return stage_with.noise[axis].likelihood_deviance + model.price(candidate);
  };
  const double now = cost(model.stage().fit.parameters, model.index(k));
  const double then = cost(found->model, found->candidate);
  return then < now - kClearly &&
         model.exchange({k}, {found->candidate, found->p_value, found->model});
}

}  // namespace plumbline
