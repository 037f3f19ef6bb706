#include "estimator/diagnosis/naming.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/diagnosis/exchange.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

/// What has no name: all of it, then what has the same driver and acts on the same, part by part.
std::vector<std::vector<std::size_t>> unlisted_of(const SearchModel& model) {
  std::vector<std::vector<std::size_t>> subsets;
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < model.size(); ++k) {
    const Candidate& chosen = model.candidate(k);
    if (chosen.has_name()) continue;
    all.push_back(k);
    const auto like_it = std::find_if(subsets.begin(), subsets.end(), [&](const auto& subset) {
      const Candidate& other = model.candidate(subset.front());
      return other.effect->id() == chosen.effect->id() && other.axis == chosen.axis;
    });
    if (like_it == subsets.end())
      subsets.push_back({k});
    else
      like_it->push_back(k);
  }
  if (subsets.size() > 1) subsets.insert(subsets.begin(), all);
  return subsets;
}

/// Some of the candidates, and what they would add.
struct Some {
  CandidateList list;
  std::vector<std::size_t> index;  ///< of each in the list that they are from
  CandidateResponses responses;
};
template <typename Condition>
Some candidates_that(SearchModel& model, const Condition& meet) {
  Some some;
  const std::vector<Candidate>& candidates = model.list().candidates;
  for (std::size_t c = 0; c < candidates.size(); ++c)
    if (meet(candidates[c])) some.index.push_back(c);
  for (const std::size_t c : some.index) some.list.candidates.push_back(candidates[c]);
  some.list.family_size = model.list().family_size;
  some.responses = some_of(model.responses(), some.index);
  return some;
}

/// The likeliest of them beside a fit, if the search as a whole would not often find as much in
/// noise and some `most` of them may gain so much in χ², and the fit with it.
struct Next {
  SearchModel::Entry entry;
  EnlargedFit fit;
};
std::optional<Next> likeliest_beside(const SearchModel& model, const Some& some,
                                     const EnlargedFit& fit, std::size_t most, double gain) {
  constexpr std::size_t kMostRefined = 4;
  constexpr double kLater = 2;       // what follows may gain more than what comes first
  constexpr double kFarBehind = 60;  // in χ²: no fewer parameters make up for it
  const CandidateGains gains(some.responses, fit);
  std::optional<Next> best;
  double best_score = std::numeric_limits<double>::infinity();
  std::size_t refined = 0;
  const Eigen::VectorXd& first_order = gains.of_residual();
  if (static_cast<double>(most) * kLater * first_order.maxCoeff() < gain) return {};
  for (const Scored& s : screen(some.list, gains, first_order)) {
    const Candidate& candidate = some.list.candidates[s.candidate];
    const bool is_there = std::any_of(
        fit.parameters.effects.begin(), fit.parameters.effects.end(), [&](const ActiveEffect& e) {
          return e.effect == candidate.effect && e.axis == candidate.axis;
        });
    if (model.is_certain(candidate) || (is_there && !candidate.effect->repeats())) continue;
    if (refined++ == kMostRefined) break;
    const std::size_t index = some.index[s.candidate];
    FitLimits limits;
    if (best) limits.chi2_of_interest = best->fit.chi2 + kFarBehind;
    EnlargedFit with = model.fit_with(gains, s.candidate, candidate,
                                      first_order(static_cast<Eigen::Index>(s.candidate)), limits);
    if (!with.determined) continue;
    const double log_p = model.log_p_of(index, fit, with, s.dof);
    const double score = log_p + (s.score - s.log_p);
    if (score >= best_score) continue;
    best_score = score;
    best = {{index, model.p_of(candidate, log_p), with.parameters}, std::move(with)};
  }
  if (best && best->entry.p > model.false_alarm(model.list().candidates[best->entry.candidate]))
    best.reset();
  return best;
}

/// The same with all shapes free, where some were held while what now stands beside them was
/// missing.
EnlargedFit with_shapes_released(const SearchModel& model, EnlargedFit fit) {
  EnlargedParameters released = fit.parameters;
  for (ActiveEffect& active : released.effects) active = with_shapes_free(std::move(active));
  if (released.free_count() == fit.parameters.free_count()) return fit;
  EnlargedFit other =
      fit_enlarged(model.input().log, model.stage().observed, model.stage().whitening, released);
  return other.determined && other.chi2 < fit.chi2 ? other : fit;
}

/// Named candidates in the place of a subset, as many as are cheapest; empty if none are worth
/// their price.
std::vector<SearchModel::Entry> names_for(const SearchModel& model, const Some& named,
                                          const std::vector<std::size_t>& subset) {
  const std::size_t most = subset.size() + 2;
  std::vector<SearchModel::Entry> names;
  std::size_t worth = 0;
  double least_cost = model.stage().fit.chi2 + model.price_of(subset) - kWorthExchanging, price = 0;
  EnlargedFit fit = model.fit_without(subset);
  while (fit.determined && names.size() < most) {
    std::optional<Next> next =
        likeliest_beside(model, named, fit, most - names.size(), fit.chi2 + price - least_cost);
    if (!next) break;
    fit = model.looked_closer(with_shapes_released(model, std::move(next->fit)));
    price += model.price_in(fit, next->entry.candidate);
    const Candidate& last = model.list().candidates[next->entry.candidate];
    const bool again = std::any_of(names.begin(), names.end(), [&](const SearchModel::Entry& name) {
      const Candidate& other = model.list().candidates[name.candidate];
      return other.effect == last.effect && other.axis == last.axis;
    });
    if (again) price += kOfForty;  // no likelier than another name
    next->entry.parameters = fit.parameters;
    names.push_back(std::move(next->entry));
    if (fit.chi2 + price >= least_cost) continue;
    least_cost = fit.chi2 + price;
    worth = names.size();
  }
  names.resize(worth);
  return names;
}

/// What an effect without a name holds as special cases: a polynomial is made of terms that have
/// names. All of them in its place; empty if they are not worth their price.
std::vector<SearchModel::Entry> parts_with_names(const SearchModel& model,
                                                 const CandidateResponses& responses,
                                                 std::size_t effect) {
  std::vector<SearchModel::Entry> parts;
  const EnlargedFit without = model.fit_without({effect});
  if (!without.determined) return parts;
  double cost = 0;
  EnlargedFit fit = without;
  for (const std::size_t c : special_cases(responses, model.stage().fit, model.index(effect))) {
    const Candidate& special = model.list().candidates[c];
    if (!special.has_name() || model.is_chosen(special)) continue;
    EnlargedFit with = model.fit_with(fit.parameters, special.active());
    if (!with.determined) continue;
    cost += model.price_in(with, c);
    parts.push_back({c, 1, with.parameters});
    fit = std::move(with);
  }
  const double now = model.stage().fit.chi2 + model.price_of({effect});
  if (parts.empty() || !(fit.chi2 + cost < now - kWorthExchanging)) return {};
  const double log_p = log_chi_squared_tail(
      without.chi2 - fit.chi2,
      static_cast<double>(fit.parameters.free_count() - without.parameters.free_count()));
  for (SearchModel::Entry& entry : parts)
    entry.p = model.p_of(model.list().candidates[entry.candidate], log_p);
  return parts;
}

/// Instead of an effect without a name the likeliest function of the same driver that has fewer
/// parameters by two or more, and a candidate with a name; empty if they are not worth their price.
std::vector<SearchModel::Entry> simpler_with_name(SearchModel& model, const Some& named,
                                                  std::size_t effect) {
  const EnlargedFit without = model.fit_without({effect});
  if (!without.determined) return {};
  const Candidate& replaced = model.candidate(effect);
  const Eigen::Index fewer = replaced.active().free_count() - 2;
  const Some simpler = candidates_that(model, [&](const Candidate& candidate) {
    return !candidate.has_name() && candidate.effect->id() == replaced.effect->id() &&
           candidate.axis == replaced.axis && candidate.active().free_count() <= fewer;
  });
  if (simpler.index.empty()) return {};
  std::optional<Next> first = likeliest_beside(model, simpler, without, 1, 0);
  if (!first) return {};
  const double least_cost = model.stage().fit.chi2 + model.price_of({effect}) - kWorthExchanging;
  const double price = model.price_in(first->fit, first->entry.candidate);
  std::optional<Next> second =
      likeliest_beside(model, named, first->fit, 1, first->fit.chi2 + price - least_cost);
  if (!second ||
      second->fit.chi2 + price + model.price_in(second->fit, second->entry.candidate) >= least_cost)
    return {};
  return {std::move(first->entry), std::move(second->entry)};
}

}  // namespace

bool name_unlisted(SearchModel& model) {
  const std::vector<std::vector<std::size_t>> subsets = unlisted_of(model);
  if (subsets.empty()) return false;
  const CandidateResponses& responses = model.responses();
  std::vector<std::vector<SearchModel::Entry>> parts(model.size()), names(subsets.size());
  parallel_for(parts.size(), [&](std::size_t k) {
    if (!model.candidate(k).has_name()) parts[k] = parts_with_names(model, responses, k);
  });
  for (std::size_t k = 0; k < parts.size(); ++k)
    if (!parts[k].empty() &&
        exchange_in_own_noise(model, {k}, parts[k], static_cast<double>(parts[k].size() - 1)))
      return true;
  const Some named =
      candidates_that(model, [](const Candidate& candidate) { return candidate.has_name(); });
  // To first order something else comes before what moves the head by several degrees.
  const Some of_head = candidates_that(model, [](const Candidate& candidate) {
    return candidate.has_name() && candidate.effect->subject() == Subject::head;
  });
  parallel_for(subsets.size(), [&](std::size_t s) {
    names[s] = names_for(model, named, subsets[s]);
    const bool moves_head = std::all_of(subsets[s].begin(), subsets[s].end(), [&](std::size_t k) {
      return model.candidate(k).effect->subject() == Subject::head;
    });
    if (names[s].empty() && moves_head) names[s] = names_for(model, of_head, subsets[s]);
  });
  for (std::size_t s = 0; s < subsets.size(); ++s) {
    const std::size_t now = subsets[s].size();
    const auto more = static_cast<double>(std::max(names[s].size(), now) - now);
    if (!names[s].empty() && exchange_in_own_noise(model, subsets[s], names[s], more)) return true;
  }
  for (std::size_t k = 0; k < model.size(); ++k) {
    const Candidate& chosen = model.candidate(k);
    if (chosen.has_name() || chosen.effect->subject() != Subject::head) continue;
    const std::vector<SearchModel::Entry> two = simpler_with_name(model, named, k);
    if (!two.empty() && exchange_in_own_noise(model, {k}, two, 1)) return true;
  }
  return false;
}

}  // namespace plumbline
