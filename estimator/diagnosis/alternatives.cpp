#include "estimator/diagnosis/alternatives.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "estimator/diagnosis/candidate_gains.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

// Odds of 100 to 1: twice the logarithm of it.
constexpr double kIndistinguishable = 9.2;
// What a further parameter must gain to be worth naming; Schwarz: ln of the number of poses.
constexpr double kPricePerParameter = 6;
constexpr std::size_t kLongestSum = 3;
constexpr std::size_t kRivalsRefined = 16;

struct Rival {
  std::size_t candidate = 0;
  double gain = 0;  ///< first order
};

// Best hypothesis of each family, largest gain first.
std::vector<Rival> best_of_families(const CandidateList& list, const CandidateGains& gains_of,
                                    const Eigen::VectorXd& gains) {
  std::vector<Rival> best(list.family_size.size(), {0, -1});
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    if (gains_of.dof(c) == 0) continue;
    Rival& family = best[list.candidates[c].family];
    const double gain = gains(static_cast<Eigen::Index>(c));
    if (gain > family.gain) family = {c, gain};
  }
  std::erase_if(best, [](const Rival& r) { return r.gain < 0; });
  std::sort(best.begin(), best.end(),
            [](const Rival& a, const Rival& b) { return a.gain > b.gain; });
  return best;
}

bool same_effect(const Candidate& a, const Candidate& b) {
  return a.effect == b.effect && (a.effect->subject() == Subject::head || a.axis == b.axis);
}

/// With Schwarz's approximation of its odds. Where the readings hardly tell a size from none or an
/// endless one, it is on its way to a limit in which it is what was found by another name: a
/// warm-up that has hardly begun at the end of the run is a drift, from a zero that may lie
/// anywhere. That has no odds. `handicap`: of the rival beyond that of what was found.
Alternative alternative(std::string name, EnlargedFit rival, const EnlargedFit& found,
                        double handicap = 0) {
  const auto further =
      static_cast<double>(rival.parameters.free_count() - found.parameters.free_count());
  const double behind =
      rival.chi2 - found.chi2 + kPricePerParameter * further + 2 * std::max(handicap, 0.0);
  constexpr double kHardly = 0.5;  // standard uncertainties of the size
  const double odds =
      leaves_a_size_open(rival, kHardly) ? 0 : std::exp(-0.5 * std::max(0.0, behind));
  return {std::move(name), std::move(rival), odds, true};
}

/// By how much the free parameters of `found` are others in a model with something else in the
/// place of effect `index`.
Eigen::VectorXd shift_to(const EnlargedParameters& rival, const EnlargedParameters& found,
                         std::size_t index) {
  Eigen::VectorXd shift = Eigen::VectorXd::Zero(found.free_count());
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    shift.segment<4>(4 * static_cast<Eigen::Index>(axis)) = rival.twelve[axis] - found.twelve[axis];
  for (std::size_t e = 0; e < found.effects.size(); ++e) {
    if (e == index) continue;
    const ActiveEffect& there = rival.effects[e < index ? e : e - 1];
    for (const EstimatedParameter& here : estimated_of(found, e))
      shift(here.row) = there.p[here.place] - here.value;
  }
  return shift;
}

/// What the codes prove is only replaced by what they prove as well.
std::vector<Alternative> proven_rivals(const SearchInput& input, const CandidateList& list,
                                       const SearchResult& result, const EnlargedParameters& base,
                                       const Candidate& found) {
  std::vector<Alternative> rivals;
  for (const Candidate& candidate : list.candidates) {
    if (candidate.axis != found.axis || candidate.effect == found.effect ||
        !candidate.effect->certain(input.log, candidate.axis))
      continue;
    EnlargedFit fit = fit_from_levels(input.log, result.observed, result.whitening,
                                      with_effect(base, candidate.active()));
    if (fit.determined)
      rivals.push_back(alternative(candidate.effect->id(), std::move(fit), result.fit));
  }
  return rivals;
}

/// A field of the room in the place of what moved the head: felt by every axis, it is one rival
/// with as many numbers as axes. The fewest of its parameters that do as much.
std::optional<Alternative> field_of_room(const SearchInput& input, const CandidateList& list,
                                         const SearchResult& result,
                                         const EnlargedParameters& base) {
  const auto field = std::find_if(list.candidates.begin(), list.candidates.end(),
                                  [](const Candidate& c) { return c.effect->of_the_room(); });
  if (field == list.candidates.end()) return {};
  const std::size_t count = field->effect->parameters().size();
  for (std::size_t only = 0; only <= count; ++only) {  // the last time all of them
    EnlargedParameters with = base;
    for (const Candidate& candidate : list.candidates) {
      if (candidate.effect != field->effect) continue;
      std::vector<double> p = candidate.hypothesis.p;
      for (std::size_t k = 0; k < count; ++k)
        if (only < count && k != only) p[k] = 0;
      if (std::any_of(p.begin(), p.end(), [](double value) { return value != 0; }))
        with = with_effect(with, candidate.with({std::move(p)}).active());
    }
    if (with.effects.size() == base.effects.size()) continue;
    EnlargedFit fit = fit_enlarged(input.log, result.observed, result.whitening, with);
    if (fit.determined && fit.chi2 <= result.fit.chi2 + kIndistinguishable)
      return alternative(field->effect->id(), std::move(fit), result.fit);
  }
  return {};
}

/// What the model leaves without the effect that was found, and what each candidate would explain
/// of it.
struct Vacancy {
  /// `base`: the model without it.
  Vacancy(const SearchInput& input, const CandidateList& from, const SearchResult& search,
          const Candidate& what_left, const EnlargedParameters& base)
      : list(from),
        result(search),
        found(what_left),
        fit_input{input.log, search.observed, search.whitening},
        without(fit_enlarged(input.log, search.observed, search.whitening, base)),
        found_gain(without.chi2 - search.fit.chi2),
        gains(*search.responses, without),
        ranked(best_of_families(list, gains, gains.of_residual())) {
    assert(result.responses->place.size() == list.candidates.size());
  }
  Vacancy(const Vacancy&) = delete;  // the gains refer to the fit beside them
  Vacancy& operator=(const Vacancy&) = delete;

  /// How much a rival with so many free parameters must explain.
  double needed(Eigen::Index free) const {
    const auto further = static_cast<double>(free - result.fit.parameters.free_count());
    return found_gain - kIndistinguishable + kPricePerParameter * further;
  }
  /// The first order may understate a nonlinear rival, but not by this much.
  bool may_do(const Rival& rival) const {
    return rival.gain >= 0.5 * found_gain - kIndistinguishable;
  }

  const CandidateList& list;
  const SearchResult& result;
  const Candidate& found;
  FitInput fit_input;
  EnlargedFit without;
  double found_gain;
  // Responses at the final model: they hardly depend on the parameters.
  CandidateGains gains;
  std::vector<Rival> ranked;
};

/// Those that do as well as what was found, one of each name, most likely first.
std::vector<Alternative> that_do_as_well(const Vacancy& vacancy, const std::vector<Rival>& rivals) {
  const Eigen::Index fewest = vacancy.result.fit.parameters.free_count();
  const FitLimits limits{.chi2_of_interest = vacancy.without.chi2 - vacancy.needed(fewest)};
  std::vector<EnlargedFit> fits(rivals.size());
  parallel_for(fits.size(), [&](std::size_t k) {
    const auto& [candidate, gain] = rivals[k];
    fits[k] = fit_with_candidate(vacancy.fit_input, vacancy.gains, candidate,
                                 vacancy.list.candidates[candidate], gain, limits);
  });
  std::vector<Alternative> alternatives;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    if (!fits[k].determined) continue;
    const Eigen::Index free =
        std::max(fits[k].parameters.free_count(), vacancy.result.fit.parameters.free_count());
    if (vacancy.without.chi2 - fits[k].chi2 < vacancy.needed(free)) continue;
    const Candidate& rival = vacancy.list.candidates[rivals[k].candidate];
    const std::string id = rival.effect->id();
    if (id == vacancy.found.effect->id() ||
        std::any_of(alternatives.begin(), alternatives.end(),
                    [&](const Alternative& other) { return other.name == id; }))
      continue;
    alternatives.push_back(alternative(id, std::move(fits[k]), vacancy.result.fit,
                                       rival.handicap - vacancy.found.handicap));
    alternatives.back().has_name = rival.has_name();
  }
  std::stable_sort(
      alternatives.begin(), alternatives.end(),
      [](const Alternative& a, const Alternative& b) { return a.fit.chi2 < b.fit.chi2; });
  return alternatives;
}

/// Named candidates, alone or, where none does alone, in sums.
std::vector<Alternative> named_rivals(const Vacancy& vacancy) {
  const CandidateList& list = vacancy.list;
  const SearchResult& result = vacancy.result;
  const auto usable = [&](const Candidate& candidate) {
    // A smooth term can imitate anything; it is no rival that could be looked for.
    if (!candidate.has_name() || same_effect(candidate, vacancy.found)) return false;
    return std::none_of(result.evidence.begin(), result.evidence.end(),
                        [&](const Evidence& e) { return same_effect(e.candidate, candidate); });
  };

  std::vector<Rival> alone;
  for (const Rival& rival : vacancy.ranked) {
    if (alone.size() == kRivalsRefined || !vacancy.may_do(rival)) break;
    if (usable(list.candidates[rival.candidate])) alone.push_back(rival);
  }
  std::vector<Alternative> singles = that_do_as_well(vacancy, alone);
  if (!singles.empty()) return singles;

  // A sum: always the rival that helps most, until it explains as much.
  std::vector<Candidate> sum;
  EnlargedFit fit = vacancy.without;
  while (sum.size() < kLongestSum) {
    // A sum whose first members leave most of it open is not worth the search.
    if (!sum.empty() && vacancy.without.chi2 - fit.chi2 < 0.8 * vacancy.found_gain) break;
    std::optional<CandidateGains> beside;
    std::vector<Rival> order = vacancy.ranked;
    if (!sum.empty()) {
      beside.emplace(*result.responses, fit);
      order = best_of_families(list, *beside, beside->of_residual());
    }
    const auto best = std::find_if(order.begin(), order.end(), [&](const Rival& r) {
      const Candidate& candidate = list.candidates[r.candidate];
      return usable(candidate) &&
             std::none_of(sum.begin(), sum.end(),
                          [&](const Candidate& member) { return same_effect(member, candidate); });
    });
    if (best == order.end()) break;
    sum.push_back(list.candidates[best->candidate]);
    fit = fit_with_candidate(vacancy.fit_input, beside ? *beside : vacancy.gains, best->candidate,
                             sum.back(), best->gain);
    if (!fit.determined) break;
    if (sum.size() < 2 ||
        vacancy.without.chi2 - fit.chi2 < vacancy.needed(fit.parameters.free_count()))
      continue;
    std::vector<std::string> ids;
    ids.reserve(sum.size());
    for (const Candidate& member : sum) ids.push_back(member.effect->id());
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    std::string name;
    for (const std::string& id : ids) name += (name.empty() ? "" : "+") + id;
    return {alternative(name, fit, result.fit)};
  }
  return {};
}

/// Functions of another driver, or of another form: the likeliest of each. In the place of a name
/// those with no more parameters than it has.
std::vector<Alternative> other_structures(const Vacancy& vacancy) {
  const auto allowed = vacancy.found.has_name() ? vacancy.result.fit.parameters.free_count() -
                                                      vacancy.without.parameters.free_count()
                                                : std::numeric_limits<Eigen::Index>::max();
  const auto candidate_of = [&](const Rival& rival) -> const Candidate& {
    return vacancy.list.candidates[rival.candidate];
  };
  const auto worth = [&](const Rival& rival) {
    return rival.gain - kPricePerParameter * vacancy.gains.dof(rival.candidate);
  };
  const auto is_there = [&](const Candidate& candidate) {
    return std::any_of(vacancy.result.evidence.begin(), vacancy.result.evidence.end(),
                       [&](const Evidence& e) {
                         return e.candidate.effect->id() == candidate.effect->id() &&
                                e.candidate.axis == candidate.axis;
                       });
  };
  std::vector<Rival> likeliest;
  for (const Rival& rival : vacancy.ranked) {
    const Candidate& candidate = candidate_of(rival);
    if (candidate.has_name() || vacancy.gains.dof(rival.candidate) > allowed ||
        !vacancy.may_do(rival) || is_there(candidate))
      continue;
    const auto same = std::find_if(likeliest.begin(), likeliest.end(), [&](const Rival& other) {
      return candidate_of(other).effect->id() == candidate.effect->id();
    });
    if (same == likeliest.end())
      likeliest.push_back(rival);
    else if (worth(rival) > worth(*same))
      *same = rival;
  }
  std::sort(likeliest.begin(), likeliest.end(),
            [&](const Rival& a, const Rival& b) { return worth(a) > worth(b); });
  if (likeliest.size() > kRivalsRefined) likeliest.resize(kRivalsRefined);
  return that_do_as_well(vacancy, likeliest);
}

}  // namespace

std::vector<Alternative> find_alternatives(const SearchInput& input, const CandidateList& list,
                                           const SearchResult& result, std::size_t index) {
  const Candidate& found = result.evidence[index].candidate;
  const EnlargedParameters base = without_effect(result.fit.parameters, index);
  if (found.effect->certain(input.log, found.axis))
    return proven_rivals(input, list, result, base, found);
  const Vacancy vacancy(input, list, result, found, base);
  std::vector<Alternative> rivals = named_rivals(vacancy);
  for (Alternative& other : other_structures(vacancy)) rivals.push_back(std::move(other));
  const bool is_there =
      std::any_of(result.evidence.begin(), result.evidence.end(),
                  [](const Evidence& e) { return e.candidate.effect->of_the_room(); });
  if (found.effect->subject() == Subject::head && !is_there) {
    if (auto field = field_of_room(input, list, result, base)) rivals.push_back(*std::move(field));
  }
  return rivals;
}

Eigen::MatrixXd covariance_among(const EnlargedParameters& found, std::size_t index,
                                 const std::vector<Alternative>& alternatives) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(found.free_count(), found.free_count());
  double odds = 1;
  for (const Alternative& alternative : alternatives) {
    const Eigen::VectorXd shift = shift_to(alternative.fit.parameters, found, index);
    covariance += alternative.odds * shift * shift.transpose();
    odds += alternative.odds;
  }
  return covariance / odds;
}

}  // namespace plumbline
