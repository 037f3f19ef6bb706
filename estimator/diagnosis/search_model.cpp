#include "estimator/diagnosis/search_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "estimator/diagnosis/residual_test.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/diagnosis/slow_look.h"
#include "estimator/fit/rounding.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

constexpr double kPerAmplitude = 7;  // Schwarz: ln of the number of means, about 3 · 324

/// Of its free parameters, at least one.
int dof_of(const ActiveEffect& effect) {
  return static_cast<int>(std::max<Eigen::Index>(1, effect.free_count()));
}

/// Whether a time constant says nothing: that of what changes within the dwell is not known to be
/// finite, that of a memory not known at all.
bool has_no_time_constant(const VisitLog& log, const EnlargedFit& fit, std::size_t effect) {
  constexpr double kDwells = 30;  // beyond so many its uncertainty is that of next to nothing
  const ActiveEffect& active = fit.parameters.effects[effect];
  const bool in_dwell = active.effect->within_dwell();
  if (!in_dwell && !active.effect->remembers()) return false;
  const Visit& visit = log.visits.front();
  const double longest_s = kDwells * visit.duration_s();
  const auto is_time_constant = [](const ParameterInfo& info) {
    return info.role == ParameterRole::shape && info.unit == "s";
  };
  const auto infos = active.effect->parameters();
  for (std::size_t k = 0; k < infos.size(); ++k) {
    if (!is_time_constant(infos[k])) continue;
    if (in_dwell ? active.p[k] > longest_s : !active.free[k]) return true;
  }
  for (const EstimatedParameter& tau : estimated_of(fit.parameters, effect))
    if (is_time_constant(tau.info) && !(fit.covariance(tau.row, tau.row) <= tau.value * tau.value))
      return true;
  return false;
}

/// Share of the run in which the head was on its way to another tilt, where it is small and
/// `effect` sets in there; 1 elsewhere.
double coincidence(const VisitLog& log, const ActiveEffect& active) {
  constexpr double kFew = 0.1;
  const auto sets_in = active.effect->sets_in_at(log, active.p);
  if (!sets_in || *sets_in == 0) return 1;
  const auto is_tilted_anew = [&](std::size_t visit) {
    constexpr double kStill_rad = 1e-4;
    return std::abs(log.visits[visit].h_rad - log.visits[visit - 1].h_rad) > kStill_rad;
  };
  if (!is_tilted_anew(*sets_in)) return 1;
  double tilting_s = 0;
  for (std::size_t k = 1; k < log.visits.size(); ++k) {
    const Visit& before = log.visits[k - 1];
    if (is_tilted_anew(k))
      tilting_s +=
          std::max(0.0, log.visits[k].t_arrival_s - before.t_arrival_s - before.duration_s());
  }
  // Where no time passes on the ways, each is an instant among those between the visits.
  const double share = std::max(tilting_s / (log.visits.back().t_arrival_s - log.first_s()),
                                1 / static_cast<double>(log.visits.size()));
  return share < kFew ? share : 1;
}

/// Whether of an amplitude, without which the effect is another, next to nothing is known.
bool lacks_what_it_needs(const EnlargedFit& fit, std::size_t effect) {
  constexpr double kKnown = 4;  // standard uncertainties
  for (const EstimatedParameter& size : estimated_of(fit.parameters, effect))
    if (size.info.needed &&
        std::abs(size.value) < kKnown * std::sqrt(fit.covariance(size.row, size.row)))
      return true;
  return false;
}

/// What an effect of a model must gain besides its price. A transient that lasts has no more right
/// to a name than what has none, and a time constant that says nothing; what starts elsewhere and
/// then does not follow its column is no function of that. What happened just when the
/// tilt changed is more likely a function of the tilt.
double surcharge(const VisitLog& log, const EnlargedFit& fit, std::size_t effect) {
  if (has_no_time_constant(log, fit, effect) || lacks_what_it_needs(fit, effect))
    return 2 * kHandicapOfUnnamed + kPerAmplitude;
  const double chance = coincidence(log, fit.parameters.effects[effect]);
  return chance < 1 ? 2 * (kHandicapOfUnnamed - std::log(chance)) : 0;
}

/// Whether two models have the same effects on an axis, whatever their sizes.
bool same_on_axis(const EnlargedParameters& a, const EnlargedParameters& b, std::size_t axis) {
  const auto effects_on = [axis](const EnlargedParameters& model) {
    std::vector<const ActiveEffect*> found;
    for (const ActiveEffect& active : model.effects)
      if (active.effect->subject() == Subject::head || active.axis == axis)
        found.push_back(&active);
    return found;
  };
  const auto of_a = effects_on(a), of_b = effects_on(b);
  return std::equal(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(),
                    [](const ActiveEffect* x, const ActiveEffect* y) {
                      if (x->effect != y->effect || x->free != y->free) return false;
                      for (std::size_t k = 0; k < x->p.size(); ++k)
                        if (!x->free[k] && x->p[k] != y->p[k]) return false;
                      return true;
                    });
}

}  // namespace

SearchModel::SearchModel(const SearchInput& input, const CandidateList& list,
                         const SearchOptions& options)
    : input_(&input), list_(&list), options_(&options) {
  Before before;
  if (input.pooled != nullptr) before.known = all_of(*input.pooled);
  // What was pooled takes rounding to a lattice for noise.
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (input.log.codes[axis].coarser_lattice) before.known[axis] = nullptr;
  stage_ = settle(input, input.start, before);
  noise_is_own_ = input.pooled == nullptr;
}

bool SearchModel::is_dropped(const Candidate& candidate) const {
  return std::count(dropped_.begin(), dropped_.end(), candidate.family) > 0;
}

bool SearchModel::is_on_another_axis(const Candidate& candidate) const {
  return candidate.effect->subject() == Subject::sensor &&
         std::any_of(chosen_.begin(), chosen_.end(), [&](std::size_t k) {
           const Candidate& chosen = list().candidates[k];
           return chosen.effect == candidate.effect && chosen.axis != candidate.axis;
         });
}

double SearchModel::looks_of(const Candidate& candidate) const {
  return is_on_another_axis(candidate) ? std::min(looks_, looks_on_axes(list(), candidate))
                                       : looks_;
}

double SearchModel::p_of(const Candidate& candidate, double log_p_local) const {
  return p_of_search(log_p_local, looks_of(candidate));
}

double SearchModel::false_alarm(const Candidate& candidate) const {
  return is_on_another_axis(candidate) ? options().false_alarm_on_another_axis
                                       : options().false_alarm;
}

PerAxis<double> SearchModel::false_alarm_of_slow() const {
  const bool slow_positions = goes_ring_by_ring(input().log);
  PerAxis<double> share;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    share[axis] = slow_positions && stage_.coarse[axis] ? options().false_alarm_of_slow_when_coarse
                                                        : options().false_alarm_of_slow;
  return share;
}

double SearchModel::price(std::size_t candidate) const {
  const Candidate& c = list().candidates[candidate];
  const Eigen::Index amplitudes = with_shapes_held(c.active()).free_count();
  return 2 * (std::log(static_cast<double>(list().family_size[c.family])) + c.handicap) +
         kPerAmplitude * static_cast<double>(std::max<Eigen::Index>(1, amplitudes));
}

double SearchModel::price_of(const std::vector<std::size_t>& effects) const {
  double sum = 0;
  for (const std::size_t k : effects)
    sum += price(chosen_[k]) + surcharge(input().log, stage_.fit, k);
  return sum;
}

double SearchModel::price() const {
  std::vector<std::size_t> all(size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return price_of(all);
}

double SearchModel::cost(const Stage& freed, const PerAxis<bool>& axes) const {
  double sum = price();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (axes[axis]) sum += deviance_of_axis(input(), stage_.fit.parameters, axis, freed);
  return sum;
}

double SearchModel::price_in(const EnlargedFit& with, std::size_t candidate) const {
  return price(candidate) + surcharge(input().log, with, with.parameters.effects.size() - 1);
}

double SearchModel::log_p_of(std::size_t candidate, const EnlargedFit& before,
                             const EnlargedFit& with, int dof) const {
  const double log_p_gaussian = log_chi_squared_tail(before.chi2 - with.chi2, dof);
  if (!list().candidates[candidate].of_one_coarse_reading) return log_p_gaussian;
  const auto before_V = predict_means_V(input().log, before.parameters);
  const auto with_V = predict_means_V(input().log, with.parameters);
  PerAxis<double> moved_V;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    moved_V[i] = (with_V[i] - before_V[i]).lpNorm<Eigen::Infinity>();
    if (moved_V[i] > input().log.step_V(i)) return log_p_gaussian;
  }
  // The axes round independently of each other: Fisher's sum of their log-probabilities.
  const Eigen::Index n = std::ssize(input().log.visits);
  double sum = 0;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const Eigen::Index row = static_cast<Eigen::Index>(axis) * n;
    const double of_axis = before.whitened_residual.segment(row, n).squaredNorm() -
                           with.whitened_residual.segment(row, n).squaredNorm();
    if (!(of_axis > 0)) continue;
    // Rounding makes single means stray, but no further than it moves any: once to one side, where
    // it is undone to the other.
    const double strays_V =
        2 * largest_rounding_bias_V(input().log.step_V(axis), input().log.input_sd_V[axis]);
    const double beyond = std::sqrt(of_axis) * std::max(0.0, 1 - strays_V / moved_V[axis]);
    const double p =
        std::min(f_tail(of_axis, 1, kDofOfCoarseReadings), normal_two_sided_tail(beyond));
    sum -= 2 * std::log(std::max(p, std::numeric_limits<double>::min()));
  }
  return log_chi_squared_tail(sum, 2.0 * kAxisCount);
}

EnlargedFit SearchModel::fit_with(const EnlargedParameters& model, const ActiveEffect& active,
                                  const FitLimits& limits) const {
  return fit_holding_shapes(input().log, stage_.observed, stage_.whitening,
                            with_effect(model, active), model.effects.size(), limits);
}

EnlargedFit SearchModel::fit_with(const CandidateGains& gains, std::size_t place,
                                  const Candidate& candidate, double promised,
                                  const FitLimits& limits) const {
  return fit_with_candidate({input().log, stage_.observed, stage_.whitening}, gains, place,
                            candidate, promised, limits);
}

EnlargedFit SearchModel::fit_without(const std::vector<std::size_t>& effects) const {
  // What is missing may drive the shapes of the others to where they change nothing.
  return fit_holding_shapes(input().log, stage_.observed, stage_.whitening,
                            without_effects(stage_.fit.parameters, effects), 0);
}

bool SearchModel::adopt(const EnlargedParameters& parameters) {
  Before before{.whitening = &stage_.whitening, .start = &stage_.noise};
  for (std::size_t axis = 0; noise_is_own_ && axis < kAxisCount; ++axis)
    if (same_on_axis(parameters, stage_.fit.parameters, axis))
      before.known[axis] = &stage_.noise[axis];
  Stage next = settle(input(), parameters, before);
  if (!next.fit.determined && !parameters.effects.empty()) {
    // Against less noise a shape may go on to where it changes nothing any more.
    EnlargedParameters held = parameters;
    held.effects.back() = with_shapes_held(std::move(held.effects.back()));
    next = settle(input(), held, before);
  }
  // Fit by fit a sensitivity may go far.
  constexpr double kLargestChange = 3;  // as a ratio
  if (!next.fit.determined ||
      !keeps_sensitivities(next.fit.parameters, input().start, kLargestChange))
    return false;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (before.known[axis] != nullptr) next.crossing_V2[axis] = std::move(stage_.crossing_V2[axis]);
  stage_ = std::move(next);
  noise_is_own_ = true;
  responses_.reset();
  return true;
}

const CandidateResponses& SearchModel::responses() {
  if (!responses_)
    responses_ = std::make_shared<const CandidateResponses>(
        candidate_responses(input().log, list(), stage_.whitening, stage_.fit.parameters));
  return *responses_;
}

bool SearchModel::is_certain(const Candidate& candidate) const {
  return candidate.effect->certain(input().log, candidate.axis);
}

bool SearchModel::is_chosen(const Candidate& candidate) const {
  if (is_certain(candidate)) return true;  // joins the model by itself
  return !candidate.effect->repeats() &&
         std::any_of(chosen_.begin(), chosen_.end(), [&](std::size_t k) {
           return list().candidates[k].effect == candidate.effect &&
                  list().candidates[k].axis == candidate.axis;
         });
}

bool SearchModel::is_chosen_beside(const std::vector<std::size_t>& effects,
                                   const Candidate& candidate) const {
  return is_chosen(candidate) && std::none_of(effects.begin(), effects.end(), [&](std::size_t k) {
           return this->candidate(k).effect == candidate.effect;
         });
}

void SearchModel::forget(std::size_t effect) {
  chosen_.erase(chosen_.begin() + static_cast<std::ptrdiff_t>(effect));
  p_values_.erase(p_values_.begin() + static_cast<std::ptrdiff_t>(effect));
}

EnlargedFit SearchModel::looked_closer(EnlargedFit fit) const {
  constexpr int kMostMoves = 6;
  for (int moves = 0; moves < kMostMoves; ++moves) {
    std::optional<EnlargedFit> closer = closer_to(fit);
    if (!closer) break;
    fit = *std::move(closer);
  }
  return fit;
}

std::optional<EnlargedFit> SearchModel::closer_to(const EnlargedFit& fit) const {
  constexpr double kClearly = 10;
  const ActiveEffect& newcomer = fit.parameters.effects.back();
  const std::vector<Hypothesis> closer =
      newcomer.effect->closer(input().log, newcomer.axis, {newcomer.p});
  std::vector<EnlargedFit> fits(closer.size());
  const auto fit_all = [&](const FitLimits& limits) {
    parallel_for(fits.size(), [&](std::size_t k) {
      fits[k] =
          fit_enlarged(input().log, stage_.observed, stage_.whitening, fits[k].parameters, limits);
    });
  };
  for (std::size_t k = 0; k < closer.size(); ++k) {
    fits[k].parameters = fit.parameters;
    fits[k].parameters.effects.back().p = closer[k].p;
  }
  // Of many, the best few are known before they have settled.
  constexpr std::size_t kFew = 8;
  if (fits.size() > kFew) {
    constexpr int kFirstLook = 2;
    fit_all({.most_iterations = kFirstLook});
    std::erase_if(fits, [](const EnlargedFit& with) { return !with.determined; });
    std::stable_sort(fits.begin(), fits.end(),
                     [](const EnlargedFit& a, const EnlargedFit& b) { return a.chi2 < b.chi2; });
    fits.resize(std::min(fits.size(), kFew));
  }
  fit_all({.chi2_of_interest = fit.chi2 - kClearly});
  std::optional<EnlargedFit> best;
  for (EnlargedFit& with : fits)
    if (with.determined && with.chi2 < fit.chi2 - kClearly && (!best || with.chi2 < best->chi2))
      best = std::move(with);
  return best;
}

void SearchModel::look_closer() {
  const EnlargedFit closer = looked_closer(stage_.fit);
  if (closer.chi2 < stage_.fit.chi2) adopt(closer.parameters);
}

/// Leaves open what nothing recorded decides where that is clearly the likelier.
void SearchModel::leave_ties_open() {
  constexpr double kClearly = 10;  // of −2 ln L
  for (std::size_t k = 0; k < chosen_.size(); ++k) {
    const ActiveEffect& active = stage_.fit.parameters.effects[k];
    const std::vector<double> open =
        active.effect->with_ties_open(input().log, active.axis, active.p);
    if (open.empty()) continue;
    EnlargedParameters parameters = stage_.fit.parameters;
    parameters.effects[k].p = open;
    const Before before{.start = &stage_.noise, .freed = &stage_};
    const Stage as_it_is = settle_noise(input(), stage_.fit.parameters, before);
    const Stage left_open = settle_noise(input(), parameters, before);
    double gain = 0;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      gain += as_it_is.noise[axis].likelihood_deviance - left_open.noise[axis].likelihood_deviance;
    if (gain > kClearly) adopt(parameters);
  }
}

bool SearchModel::add(const Entry& with) { return exchange({}, with); }

bool SearchModel::exchange(const std::vector<std::size_t>& effects, const Entry& with) {
  return exchange(effects, std::vector{with});
}

bool SearchModel::exchange(const std::vector<std::size_t>& effects, std::vector<Entry> with) {
  if (with.size() == 1) with.front().p = p_in_place_of(effects, with.front());
  if (!adopt(with.back().parameters)) return false;
  for (auto k = effects.rbegin(); k != effects.rend(); ++k) forget(*k);
  for (const Entry& newcomer : with) {
    chosen_.push_back(newcomer.candidate);
    p_values_.push_back(newcomer.p);
  }
  look_closer();
  leave_ties_open();
  return true;
}

double SearchModel::p_in_place_of(const std::vector<std::size_t>& effects,
                                  const Entry& newcomer) const {
  double p_before = 0;
  for (const std::size_t k : effects) p_before = std::max(p_before, p_values_[k]);
  if (newcomer.p >= p_before || !may_be_slow_noise(input(), newcomer.parameters)) return newcomer.p;
  const EnlargedFit without = fit_without(effects);
  if (!without.determined) return newcomer.p;
  const Candidate& candidate = list().candidates[newcomer.candidate];
  const double log_p =
      log_p_in_own_noise(input(), newcomer.parameters, without.parameters, candidate.axis,
                         dof_of(newcomer.parameters.effects.back()), stage_);
  return std::max(newcomer.p, std::min(p_before, p_of(candidate, log_p)));
}

double SearchModel::p_of_removal(std::size_t effect, const EnlargedFit& without,
                                 double excess) const {
  const auto free =
      static_cast<double>(stage_.fit.parameters.free_count() - without.parameters.free_count());
  return p_of(candidate(effect),
              log_chi_squared_tail((without.chi2 - stage_.fit.chi2) / excess, std::max(1.0, free)));
}

bool SearchModel::drop(const std::vector<std::size_t>& effects) {
  return drop(effects, fit_without(effects));
}

bool SearchModel::drop(const std::vector<std::size_t>& effects, const EnlargedFit& without) {
  if (!without.determined || !adopt(without.parameters)) return false;
  for (auto k = effects.rbegin(); k != effects.rend(); ++k) {
    dropped_.push_back(candidate(*k).family);
    forget(*k);
  }
  return true;
}

double SearchModel::excess(std::size_t effect) const {
  constexpr double kByChance = 1e-6, kMatters = 1.2;
  const ActiveEffect& active = stage_.fit.parameters.effects[effect];
  const Eigen::Index n = std::ssize(input().log.visits);
  double square = 0, dof = 0;
  for (const std::size_t axis : axes_of(active)) {
    if (stage_.coarse[axis]) return 1;  // of which the residual is no measure
    square +=
        stage_.fit.whitened_residual.segment(static_cast<Eigen::Index>(axis) * n, n).squaredNorm();
    dof += static_cast<double>(n) - 4;
  }
  if (dof <= 0 || square < kMatters * dof || chi_squared_tail(square, dof) > kByChance) return 1;
  return square / dof;
}

void SearchModel::drop_what_excess_explains() {
  for (;;) {
    std::optional<std::size_t> weakest;
    EnlargedFit without_weakest;
    double most = 1;  // of p over what is allowed
    for (std::size_t k = 0; k < chosen_.size(); ++k) {
      const double beyond = excess(k);
      if (beyond == 1 || is_certain(candidate(k))) continue;
      EnlargedFit without = fit_without({k});
      if (!without.determined) continue;
      const double ratio = p_of_removal(k, without, beyond) / false_alarm(candidate(k));
      if (ratio <= most) continue;
      most = ratio;
      weakest = k;
      without_weakest = std::move(without);
    }
    if (!weakest || !drop({*weakest}, without_weakest)) return;
  }
}

void SearchModel::drop_superfluous() {
  // Those from `end` on are not, or are gone.
  for (std::size_t end = chosen_.size(); end > 0 && chosen_.size() > 1;) {
    std::vector<std::optional<EnlargedFit>> without(end);
    parallel_for(end, [&](std::size_t k) {
      if (!is_certain(candidate(k))) without[k] = fit_without({k});
    });
    const auto is_superfluous = [&](std::size_t k) {
      return without[k] && without[k]->determined &&
             p_of_removal(k, *without[k]) >= false_alarm(candidate(k));
    };
    while (end > 0 && !is_superfluous(end - 1)) --end;
    if (end == 0) return;
    --end;
    drop({end}, *without[end]);
  }
}

SearchResult SearchModel::take_result() {
  SearchResult result;
  result.evidence.resize(chosen_.size());
  parallel_for(chosen_.size(), [&](std::size_t k) {
    const double lost = fit_without({k}).chi2 - stage_.fit.chi2;
    result.evidence[k] = {
        candidate(k), p_values_[k],
        sigmas_of(log_chi_squared_tail(lost, dof_of(stage_.fit.parameters.effects[k])))};
  });
  responses();
  result.responses = std::move(responses_);
  result.fit = std::move(stage_.fit);
  result.observed = std::move(stage_.observed);
  result.own_V2 = std::move(stage_.own_V2);
  result.coarse = stage_.coarse;
  result.beyond_V2 = stage_.beyond_V2;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (stage_.crossing_V2[axis].size() > 0) result.own_V2[axis] += stage_.crossing_V2[axis];
  result.noise = std::move(stage_.noise);
  result.whitening = std::move(stage_.whitening);
  return result;
}

}  // namespace plumbline
