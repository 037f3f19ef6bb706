#include "estimator/diagnosis/exchange.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "estimator/diagnosis/screening.h"
#include "estimator/diagnosis/slow_look.h"
#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

/// How many names beyond the first some of the model's effects have, of which there are any.
double further_names(const SearchModel& model, const std::vector<std::size_t>& effects) {
  std::set<const Effect*> names;
  for (const std::size_t k : effects) names.insert(model.candidate(k).effect);
  return static_cast<double>(names.size() - 1);
}

/// Sum of squares of a fit. What a candidate makes of the first visit is a guess, which counts
/// neither for it nor for what it would replace.
double chi2_beside(const SearchModel& model, const Candidate& candidate, const EnlargedFit& fit) {
  if (!candidate.effect->guesses_at_start()) return fit.chi2;
  const Eigen::Index n = std::ssize(model.input().log.visits);
  double at_start = 0;
  for (Eigen::Index row = 0; row < mean_rows(model.input().log); row += n)
    at_start += fit.whitened_residual(row) * fit.whitened_residual(row);
  return fit.chi2 - at_start;
}

}  // namespace

bool exchange_in_own_noise(SearchModel& model, const std::vector<std::size_t>& effects,
                           const std::vector<SearchModel::Entry>& with, double more_names) {
  PerAxis<bool> touched{};
  for (const std::size_t k : effects)
    for (const std::size_t axis : axes_of(model.stage().fit.parameters.effects[k]))
      touched[axis] = true;
  bool has_slow = false;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    has_slow = has_slow || (touched[axis] && has_slow_noise(model.input(), model.stage(), axis));
  if (!has_slow) return model.exchange(effects, with);
  // In slow noise some two names always come close.
  const double more = kOfForty * more_names;
  const SearchModel before = model;
  if (!model.exchange(effects, with)) return false;
  model.drop_superfluous();
  if (model.cost(before.stage(), touched) + more < before.cost(before.stage(), touched))
    return true;
  model = before;
  return false;
}

namespace {

/// Whether two effects mostly take back what the other does beside the 12 parameters: two names
/// that happen to add up to something else.
bool take_back_each_other(const SearchModel& model, std::size_t first, std::size_t second) {
  constexpr double kMostLeft = 0.7;  // of the smaller
  const EnlargedFit& fit = model.stage().fit;
  constexpr Eigen::Index kTwelve = 4 * kAxisCount;
  const Eigen::MatrixXd basis = orthonormal_basis(fit.whitened_jacobian.leftCols(kTwelve));
  const auto contribution = [&](std::size_t effect) {
    const Eigen::VectorXd sum = whitened_contribution(fit, effect);
    return Eigen::VectorXd(sum - basis * (basis.transpose() * sum));
  };
  const Eigen::VectorXd one = contribution(first), other = contribution(second);
  return (one + other).norm() < kMostLeft * std::min(one.norm(), other.norm());
}

/// The likeliest `most`, and as many of those with a name: to first order the response of a large
/// effect falls behind functions without a name that happen to run like it.
std::vector<Scored> worth_refining(const CandidateList& list, const std::vector<Scored>& ranked,
                                   std::size_t most) {
  std::vector<Scored> likeliest;
  std::size_t named = 0;
  for (const Scored& s : ranked) {
    const bool has_name = list.candidates[s.candidate].has_name();
    if (likeliest.size() >= most && (!has_name || named >= most)) continue;
    named += has_name ? 1 : 0;
    likeliest.push_back(s);
  }
  return likeliest;
}

/// What of the likeliest `most` is worth its price in the place of a subset, likeliest first.
std::vector<SearchModel::Entry> exchanges_for(const SearchModel& model,
                                              const CandidateResponses& responses,
                                              const std::vector<std::size_t>& subset,
                                              std::size_t most) {
  constexpr double kMayGain = 2, kOthersMayGain = 60;  // more than to first order, in χ²
  constexpr double kNearEnough = 0.5;                  // of what the subset explains
  std::vector<SearchModel::Entry> exchanges;
  const EnlargedFit without = model.fit_without(subset);
  if (!without.determined) return exchanges;
  const bool two_for_one =
      subset.size() == 2 && take_back_each_other(model, subset.front(), subset.back());
  const double spent = model.price_of(subset) + (two_for_one ? 2 * kHandicapOfUnnamed : 0) +
                       kOfForty * further_names(model, subset);
  const EnlargedParameters others = without_effects(model.stage().fit.parameters, subset);
  const CandidateGains gains(responses, without);
  const Eigen::VectorXd& first_order = gains.of_residual();
  for (const Scored& scored :
       worth_refining(model.list(), screen(model.list(), gains, first_order), most)) {
    const std::size_t index = scored.candidate;
    const Candidate& candidate = model.list().candidates[index];
    const Candidate& replaced = model.candidate(subset.front());
    if (subset.size() == 1 && candidate.family == replaced.family &&
        candidate.hypothesis.p == replaced.hypothesis.p)
      continue;
    if (model.is_chosen_beside(subset, candidate)) continue;
    const double now = chi2_beside(model, candidate, model.stage().fit) + spent;
    const double promised = first_order(static_cast<Eigen::Index>(index));
    const double needed = now - model.price(index);
    const double left_out = chi2_beside(model, candidate, without);
    if (left_out - kMayGain * promised - kOthersMayGain > needed) continue;
    const double at_start = without.chi2 - left_out;
    const FitLimits limits{.chi2_of_interest = needed + at_start};
    // The shapes of the others may have run away beside the gap, from where they do not come back.
    EnlargedFit with = model.fit_with(others, candidate.active(), limits);
    if (!with.determined || with.chi2 > limits.chi2_of_interest)
      with = model.fit_with(gains, index, candidate, promised, limits);
    // What several make up for where they are, a single one has yet to find.
    const double left = with.chi2 - model.stage().fit.chi2;
    if (subset.size() > 1 && with.chi2 > limits.chi2_of_interest &&
        left < kNearEnough * (without.chi2 - model.stage().fit.chi2))
      with = model.looked_closer(std::move(with));
    if (!with.determined) continue;
    const double cost = chi2_beside(model, candidate, with) + model.price_in(with, index);
    if (!(cost < now - kWorthExchanging)) continue;
    const double p = model.p_of(candidate, model.log_p_of(index, without, with, gains.dof(index)));
    if (p <= model.false_alarm(candidate)) exchanges.push_back({index, p, with.parameters});
  }
  return exchanges;
}

/// What one candidate may take the place of: one effect, two, all that one axis has, or all that
/// the head has.
std::vector<std::vector<std::size_t>> exchangeable(const SearchModel& model) {
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < model.size(); ++k)
    if (!model.is_certain(model.candidate(k))) open.push_back(k);
  std::vector<std::vector<std::size_t>> subsets;
  subsets.reserve(open.size());
  for (const std::size_t k : open) subsets.push_back({k});
  for (auto k = open.begin(); k != open.end(); ++k)
    for (auto l = k + 1; l != open.end(); ++l) subsets.push_back({*k, *l});
  const auto add_all = [&](const auto& belongs) {
    std::vector<std::size_t> all;
    for (const std::size_t k : open)
      if (belongs(model.candidate(k))) all.push_back(k);
    if (all.size() > 2) subsets.push_back(std::move(all));
  };
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    add_all([axis](const Candidate& candidate) {
      return candidate.axis == axis && candidate.effect->subject() == Subject::sensor;
    });
  add_all([](const Candidate& candidate) { return candidate.effect->subject() == Subject::head; });
  return subsets;
}

}  // namespace

bool exchange_one(SearchModel& model) {
  const std::vector<std::vector<std::size_t>> subsets = exchangeable(model);
  if (subsets.empty()) return false;
  // Pairs grow with the square of the effects, and their fits with their parameters.
  constexpr std::size_t kMost = 4, kMostInAll = 50, kMostOfMany = 20;
  const std::size_t most = std::clamp(kMostInAll / subsets.size(), std::size_t{1}, kMost);
  const CandidateResponses& responses = model.responses();
  std::vector<std::vector<SearchModel::Entry>> exchanges(subsets.size());
  parallel_for(subsets.size(), [&](std::size_t s) {
    exchanges[s] =
        exchanges_for(model, responses, subsets[s], subsets[s].size() > 2 ? kMostOfMany : most);
  });
  for (std::size_t s = 0; s < subsets.size(); ++s) {
    for (const SearchModel::Entry& with : exchanges[s])
      if (exchange_in_own_noise(model, subsets[s], {with}, 0)) return true;
  }
  return false;
}

namespace {

/// Candidates of one effect, the likeliest of each axis that shows it, likeliest first.
struct Kind {
  const Effect* effect = nullptr;
  std::vector<std::size_t> candidates = {};
  double gain = 0;  ///< in χ², to first order
  double price = 0;
};
std::vector<Kind> kinds_on_axes(const SearchModel& model, const CandidateGains& gains) {
  const Eigen::VectorXd& first_order = gains.of_residual();
  std::vector<Kind> kinds;
  for (const Scored& s : screen(model.list(), gains, first_order)) {
    const Candidate& candidate = model.list().candidates[s.candidate];
    if (!candidate.has_name() || candidate.effect->subject() != Subject::sensor ||
        model.is_certain(candidate) ||
        model.p_of(candidate, s.log_p) > model.false_alarm(candidate))
      continue;
    auto kind = std::find_if(kinds.begin(), kinds.end(),
                             [&](const Kind& k) { return k.effect == candidate.effect; });
    if (kind == kinds.end()) kind = kinds.insert(kinds.end(), Kind{.effect = candidate.effect});
    if (std::any_of(kind->candidates.begin(), kind->candidates.end(), [&](std::size_t c) {
          return model.list().candidates[c].axis == candidate.axis;
        }))
      continue;
    kind->candidates.push_back(s.candidate);
    kind->gain += first_order(static_cast<Eigen::Index>(s.candidate));
    kind->price += model.price(s.candidate);
  }
  return kinds;
}

/// Effects of one kind in the place of a subset; empty if none are worth their price.
std::vector<SearchModel::Entry> one_kind_for(const SearchModel& model,
                                             const CandidateResponses& responses,
                                             const std::vector<std::size_t>& subset) {
  std::vector<SearchModel::Entry> best;
  const EnlargedFit without = model.fit_without(subset);
  if (!without.determined) return best;
  double least_cost = model.stage().fit.chi2 + model.price_of(subset) +
                      kOfForty * further_names(model, subset) - kWorthExchanging;
  const CandidateGains gains(responses, without);
  for (const Kind& kind : kinds_on_axes(model, gains)) {
    constexpr double kMayGain = 1.5;  // more than to first order
    if (kind.candidates.size() < 2 || without.chi2 - kMayGain * kind.gain + kind.price > least_cost)
      continue;
    EnlargedFit fit = without;
    std::vector<SearchModel::Entry> entries;
    for (const std::size_t c : kind.candidates) {
      const Candidate& candidate = model.list().candidates[c];
      EnlargedFit with = model.fit_with(fit.parameters, candidate.active());
      if (!with.determined) break;
      const auto dof = static_cast<double>(gains.dof(c));
      entries.push_back({c, model.p_of(candidate, log_chi_squared_tail(fit.chi2 - with.chi2, dof)),
                         with.parameters});
      fit = std::move(with);
    }
    if (entries.size() < kind.candidates.size() || fit.chi2 + kind.price > least_cost) continue;
    least_cost = fit.chi2 + kind.price;
    best = std::move(entries);
  }
  return best;
}

}  // namespace

bool exchange_for_one_kind(SearchModel& model) {
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < model.size(); ++k)
    if (!model.is_certain(model.candidate(k))) all.push_back(k);
  if (all.size() < 2) return false;
  std::vector<std::vector<std::size_t>> subsets = {all};
  for (std::size_t k = 0; all.size() > 2 && k < all.size(); ++k) {
    subsets.push_back(all);
    subsets.back().erase(subsets.back().begin() + static_cast<std::ptrdiff_t>(k));
  }
  const CandidateResponses& responses = model.responses();
  for (const auto& subset : subsets) {
    const std::vector<SearchModel::Entry> kind = one_kind_for(model, responses, subset);
    if (!kind.empty() && exchange_in_own_noise(model, subset, kind, -further_names(model, subset)))
      return true;
  }
  return false;
}

bool exchange_slow(SearchModel& model, std::size_t k) {
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
                                     {beside, axes, 1, model.false_alarm_of_slow(), is_open,
                                      [](const Candidate&) { return false; }});
  if (!found || !found->significant || found->candidate == model.index(k)) return false;
  const auto cost = [&](const EnlargedParameters& with, std::size_t candidate) {
    return deviance_of_axis(model.input(), with, axis, stage) + model.price(candidate);
  };
  const double now = cost(model.stage().fit.parameters, model.index(k));
  const double then = cost(found->model, found->candidate);
  return then < now - kWorthExchanging &&
         model.exchange({k}, {found->candidate, found->p_value, found->model});
}

}  // namespace plumbline
