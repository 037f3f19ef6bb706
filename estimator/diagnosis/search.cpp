#include "estimator/diagnosis/search.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "estimator/diagnosis/edge_comb.h"
#include "estimator/diagnosis/noise_stage.h"
#include "estimator/diagnosis/residual_test.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/diagnosis/slow_look.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

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

/// The search on its way: the model, and what each of its effects cost to find.
class Search {
 public:
  Search(const SearchInput& input, const CandidateList& list, const SearchOptions& options)
      : input_(input), list_(list), options_(options) {
    Before before;
    if (input.pooled != nullptr) before.known = all_of(*input.pooled);
    stage_ = settle(input, input.start, before);
    noise_is_own_ = input.pooled == nullptr;
  }

  SearchResult run() {
    for (std::size_t c = 0; c < list_.candidates.size(); ++c)
      if (is_certain(list_.candidates[c]) && !is_proven_otherwise(list_.candidates[c]))
        adopt_proven(c);
    // Where the best of the slow ones is superfluous as soon as it is there, so are the others.
    bool worth_slow_look = true;
    while (chosen_.size() < options_.max_effects) {
      const std::size_t before = chosen_.size();
      const bool found = add_one();
      if (!found && !(worth_slow_look && add_slow_one()) && !add_train()) break;
      drop_superfluous();
      tell_in_one();
      if (!found) worth_slow_look = chosen_.size() > before;
    }
    while (exchange_one()) drop_superfluous();
    return result();
  }

 private:
  /// What a candidate must gain in χ² to be worth its freedom, its choice among many and its want
  /// of a name. About 2·ln of the number of poses a parameter.
  static constexpr double kPricePerParameter = 7;
  double price(std::size_t candidate, int dof) const {
    const Candidate& c = list_.candidates[candidate];
    return 2 * (std::log(static_cast<double>(list_.family_size[c.family])) + c.handicap) +
           kPricePerParameter * dof;
  }

  /// log of the probability that noise alone gives a candidate this gain. A single reading of a
  /// coarse converter strays further than Gaussian noise, but by no more than a step.
  double log_p_of(std::size_t candidate, double gain, int dof, const EnlargedFit& with) const {
    if (!list_.candidates[candidate].of_one_coarse_reading) return log_chi_squared_tail(gain, dof);
    const auto before = predict_means_V(input_.log, stage_.fit.parameters);
    const auto after = predict_means_V(input_.log, with.parameters);
    for (std::size_t i = 0; i < kAxisCount; ++i)
      if ((after[i] - before[i]).lpNorm<Eigen::Infinity>() > input_.log.step_V(i))
        return log_chi_squared_tail(gain, dof);
    return std::log(std::max(f_tail(gain / dof, dof, kDofOfCoarseReadings), 1e-300));
  }

  EnlargedFit fit(const EnlargedParameters& parameters) const {
    return fit_enlarged(input_.log, stage_.observed, stage_.whitening, parameters);
  }
  /// The model with one more effect.
  EnlargedFit fit_with(const EnlargedParameters& model, const ActiveEffect& active) const {
    return fit_holding_shapes(input_.log, stage_.observed, stage_.whitening,
                              with_effect(model, active), model.effects.size());
  }
  /// The model with one more effect where the linear problem puts both. What follows the readings
  /// finely may not be reached from parameters that were estimated without it. Precondition:
  /// responses() is up to date.
  EnlargedParameters linear_start(std::size_t candidate) const {
    const auto& [g, first, count] = responses_->place[candidate];
    const CandidateResponses::Group& group = responses_->groups[g];
    const Eigen::MatrixXd& model = stage_.fit.whitened_jacobian;
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(model.rows(), model.cols() + count);
    columns.leftCols(model.cols()) = model;
    columns.block(group.first_row, model.cols(), group.means.rows(), count) =
        group.means.middleCols(first, count);
    columns.block(group.first_dwell_row, model.cols(), group.dwells.rows(), count) =
        group.dwells.middleCols(first, count);
    const Eigen::VectorXd norms = columns.colwise().norm().cwiseMax(1e-300);
    const Eigen::VectorXd step =
        norms.cwiseInverse().cwiseProduct((columns * norms.cwiseInverse().asDiagonal())
                                              .colPivHouseholderQr()
                                              .solve(stage_.fit.whitened_residual));
    EnlargedParameters start = stage_.fit.parameters;
    start.set_free_values(start.free_values() + step.head(model.cols()));
    ActiveEffect active = list_.candidates[candidate].active();
    const auto infos = active.effect->parameters();
    Eigen::Index column = model.cols();
    for (std::size_t k = 0; k < infos.size(); ++k)
      if (infos[k].role == ParameterRole::amplitude && active.p[k] != 0)
        active.p[k] *= step(column++);
    return with_effect(std::move(start), active);
  }
  /// What the codes prove joins the model.
  void adopt_proven(std::size_t candidate) {
    const EnlargedFit with =
        fit_from_levels(input_.log, stage_.observed, stage_.whitening,
                        with_effect(stage_.fit.parameters, list_.candidates[candidate].active()));
    if (with.determined && adopt(with.parameters)) choose(candidate, kProven);
  }
  EnlargedFit fit_without(const std::vector<std::size_t>& removed) const {
    EnlargedParameters fewer = stage_.fit.parameters;
    for (auto k = removed.rbegin(); k != removed.rend(); ++k)
      fewer.effects.erase(fewer.effects.begin() + static_cast<std::ptrdiff_t>(*k));
    return fit(fewer);
  }
  /// Takes over a model when its parameters are determined.
  bool adopt(const EnlargedParameters& parameters) {
    Before before{{}, &stage_.noise, nullptr};
    for (std::size_t axis = 0; noise_is_own_ && axis < kAxisCount; ++axis)
      if (same_on_axis(parameters, stage_.fit.parameters, axis))
        before.known[axis] = &stage_.noise[axis];
    Stage next = settle(input_, parameters, before);
    if (!next.fit.determined) return false;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (before.known[axis] != nullptr)
        next.crossing_V2[axis] = std::move(stage_.crossing_V2[axis]);
    stage_ = std::move(next);
    noise_is_own_ = true;
    responses_.reset();
    return true;
  }

  /// Those of the candidates beside the model as it stands.
  const CandidateResponses& responses() {
    if (!responses_)
      responses_ = candidate_responses(input_.log, list_, stage_.whitening, stage_.fit.parameters);
    return *responses_;
  }

  /// Adds the best candidate if the search as a whole would not often find as much in noise.
  bool add_one() {
    const CandidateGains gains(responses(), stage_.fit);
    const Eigen::VectorXd first_order = gains.of(stage_.fit.whitened_residual).col(0);
    std::vector<Scored> ranked = screen(list_, gains, first_order);
    std::erase_if(ranked, [&](const Scored& s) {
      const Candidate& c = list_.candidates[s.candidate];
      return std::count(dropped_.begin(), dropped_.end(), c.family) > 0 || is_chosen(c);
    });
    if (ranked.empty()) return false;
    // The number of looks hardly changes while the model grows.
    if (looks_ == 0)
      looks_ = effective_looks(gains, list_.candidates.size(), stage_.fit.whitened_residual.size(),
                               options_.seed, options_.replicates);
    const auto surest =
        std::min_element(ranked.begin(), ranked.end(),
                         [](const Scored& a, const Scored& b) { return a.log_p < b.log_p; });
    p_best_rest_ = p_of_search(surest->log_p, looks_);
    if (p_best_rest_ > options_.false_alarm) return false;

    // First order ranks; the full response decides.
    constexpr std::size_t kRefined = 10;
    constexpr double kMostOfIt = 0.95;
    std::vector<EnlargedFit> fits(std::min(kRefined, ranked.size()));
    parallel_for(fits.size(), [&](std::size_t k) {
      const std::size_t candidate = ranked[k].candidate;
      fits[k] = fit_with(stage_.fit.parameters, list_.candidates[candidate].active());
      const double promised = first_order(static_cast<Eigen::Index>(candidate));
      // From next to nothing a place or a time constant may have run to where it explains less.
      if (fits[k].determined && stage_.fit.chi2 - fits[k].chi2 > kMostOfIt * promised) return;
      EnlargedFit other = fit(linear_start(candidate));
      if (other.determined && (!fits[k].determined || other.chi2 < fits[k].chi2))
        fits[k] = std::move(other);
    });
    const Scored* winner = nullptr;
    EnlargedParameters with_winner;
    double winner_score = std::numeric_limits<double>::infinity(), winner_log_p = 0;
    for (std::size_t k = 0; k < fits.size(); ++k) {
      const Scored& s = ranked[k];
      const EnlargedFit& with = fits[k];
      if (!with.determined) continue;
      const double log_p =
          log_p_of(s.candidate, stage_.fit.chi2 - with.chi2, gains.dof(s.candidate), with);
      const double score = log_p + (s.score - s.log_p);
      if (score < winner_score) {
        winner = &s;
        with_winner = with.parameters;
        winner_score = score;
        winner_log_p = log_p;
      }
    }
    if (winner == nullptr) return replace_overlapping(ranked, gains);
    const double p = p_of_search(winner_log_p, looks_);
    if (p > options_.false_alarm || !adopt(with_winner)) return false;
    choose(winner->candidate, p);
    return true;
  }

  /// A slow effect that the noise was estimated without is partly taken for slow noise, and then
  /// hides in it. Looked for where the noise is clearly smaller beside few functions of time, and
  /// where there is noise to hide in, beside any course of time.
  bool add_slow_one() {
    constexpr double kWorthALook = 1e-3;
    if (add_slow_one(slow_functions(input_.log), {true, true, true}, kWorthALook)) return true;
    PerAxis<bool> slow_noise{};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      slow_noise[axis] = has_slow_noise(input_, stage_, axis);
    if (slow_noise == PerAxis<bool>{}) return false;
    // So many functions are seldom better as a whole, even if one of them is the truth.
    return add_slow_one(any_course_of_time(input_.log), slow_noise, 1);
  }

  bool add_slow_one(const Eigen::MatrixXd& beside, const PerAxis<bool>& axes, double worth_a_look) {
    const auto is_open = [&](const Candidate& c) {
      return std::count(dropped_.begin(), dropped_.end(), c.family) == 0 && !is_chosen(c);
    };
    const auto found =
        look_among_slow(input_, list_, stage_, noise_is_own_,
                        {beside, axes, worth_a_look, options_.false_alarm_of_slow, is_open});
    if (!found) return false;
    p_best_rest_ = std::min(p_best_rest_, found->p_value);
    if (found->p_value > options_.false_alarm_of_slow || !adopt(found->model)) return false;
    choose(found->candidate, found->p_value);
    return true;
  }

  /// A term that holds one of the model's effects as a special case cannot stand beside it: it
  /// takes its place.
  bool replace_overlapping(const std::vector<Scored>& ranked, const CandidateGains& gains) {
    for (std::size_t r = 0; r < std::min<std::size_t>(3, ranked.size()); ++r) {
      const std::size_t candidate = ranked[r].candidate;
      for (std::size_t k = 0; k < chosen_.size(); ++k) {
        const EnlargedFit without = fit_without({k});
        const EnlargedFit with = fit_with(without.parameters, list_.candidates[candidate].active());
        if (!with.determined) continue;
        const double gained = stage_.fit.chi2 - with.chi2;
        const double p =
            p_of_search(log_p_of(candidate, gained, gains.dof(candidate), with), looks_);
        if (p > options_.false_alarm || !adopt(with.parameters)) continue;
        forget(k);
        choose(candidate, p);
        return true;
      }
    }
    return false;
  }

  bool is_certain(const Candidate& candidate) const {
    return candidate.effect->certain(input_.log);
  }
  /// Two effects that the codes of an axis prove are two names for one.
  bool is_proven_otherwise(const Candidate& candidate) const {
    return std::any_of(chosen_.begin(), chosen_.end(), [&](std::size_t k) {
      const Candidate& chosen = list_.candidates[k];
      return chosen.axis == candidate.axis && chosen.effect != candidate.effect &&
             is_certain(chosen);
    });
  }

  /// An effect stands in the model once; a second pose, slip or step is another matter.
  bool is_chosen(const Candidate& candidate) const {
    if (is_certain(candidate)) return true;  // in the model from the start
    return !candidate.effect->repeats() &&
           std::any_of(chosen_.begin(), chosen_.end(), [&](std::size_t k) {
             return list_.candidates[k].effect == candidate.effect &&
                    list_.candidates[k].axis == candidate.axis;
           });
  }

  void forget(std::size_t k) {
    chosen_.erase(chosen_.begin() + static_cast<std::ptrdiff_t>(k));
    p_values_.erase(p_values_.begin() + static_cast<std::ptrdiff_t>(k));
  }
  void choose(std::size_t candidate, double p) {
    chosen_.push_back(candidate);
    p_values_.push_back(p);
    look_closer();
  }

  /// Puts one of those close to the newcomer in its place that explains clearly more.
  void look_closer() {
    constexpr double kClearly = 10;
    const ActiveEffect& newcomer = stage_.fit.parameters.effects.back();
    const std::vector<Hypothesis> closer =
        newcomer.effect->closer(input_.log, newcomer.axis, {newcomer.p});
    std::vector<EnlargedFit> fits(closer.size());
    parallel_for(fits.size(), [&](std::size_t k) {
      EnlargedParameters model = stage_.fit.parameters;
      model.effects.back().p = closer[k].p;
      fits[k] = fit(model);
    });
    const EnlargedFit* best = nullptr;
    for (const EnlargedFit& with : fits)
      if (with.determined && with.chi2 < stage_.fit.chi2 - kClearly &&
          (best == nullptr || with.chi2 < best->chi2))
        best = &with;
    if (best != nullptr) adopt(best->parameters);
  }

  double p_of_removal(const EnlargedFit& without) const {
    const auto free =
        static_cast<double>(stage_.fit.parameters.free_count() - without.parameters.free_count());
    return p_of_search(log_chi_squared_tail(without.chi2 - stage_.fit.chi2, std::max(1.0, free)),
                       looks_);
  }

  /// What a newcomer has made superfluous goes.
  void drop_superfluous() {
    for (std::size_t k = chosen_.size(); k-- > 0 && chosen_.size() > 1;) {
      if (is_certain(list_.candidates[chosen_[k]])) continue;
      const EnlargedFit without = fit_without({k});
      if (!without.determined || p_of_removal(without) < options_.false_alarm) continue;
      if (!adopt(without.parameters)) continue;
      // What proved superfluous once would come back and go again.
      dropped_.push_back(list_.candidates[chosen_[k]].family);
      forget(k);
    }
  }

  /// What happened again and again on an axis may be one thing that repeats.
  void tell_in_one() {
    for (std::size_t k = 0; k < chosen_.size(); ++k) {
      const Candidate& first = list_.candidates[chosen_[k]];
      if (is_step(first)) {
        const std::vector<std::size_t> steps = of_regular_steps(first.axis);
        const auto first_step = std::find_if(steps.begin(), steps.end(), [&](std::size_t l) {
          return is_step(list_.candidates[chosen_[l]]);
        });
        if (k == *first_step && steps.size() > 1 && put_train_in_place_of(steps, first.axis))
          return;
        continue;
      }
      std::vector<std::size_t> instances;
      std::vector<std::vector<double>> p;
      for (std::size_t l = k; l < chosen_.size(); ++l) {
        const Candidate& other = list_.candidates[chosen_[l]];
        if (other.effect != first.effect || other.axis != first.axis) continue;
        instances.push_back(l);
        p.push_back(stage_.fit.parameters.effects[l].p);
      }
      if (instances.size() > 1 && replace_in_one(instances, first, p, looks_)) return;
    }
  }

  /// Steps at regular times that say nothing one by one.
  bool add_train() {
    // One that takes the place of another could be followed by that again.
    constexpr int kMostTrains = 6;
    if (trains_ == kMostTrains) return false;
    ++trains_;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const std::vector<std::size_t> found = of_regular_steps(axis);
      if (put_train_in_place_of(found, axis)) return true;
      // What stepped by itself may stay beside it, another train not.
      if (!found.empty() &&
          std::all_of(found.begin(), found.end(),
                      [&](std::size_t k) { return is_step(list_.candidates[chosen_[k]]); }) &&
          put_train_in_place_of({}, axis))
        return true;
    }
    return false;
  }

  static bool is_step(const Candidate& candidate) {
    return candidate.effect->id() == "sensor.bias_step";
  }
  /// What the model holds of an axis that steps: steps one by one, and trains of them.
  std::vector<std::size_t> of_regular_steps(std::size_t axis) const {
    const std::vector<std::vector<double>> any_train = {{1, 0}, {1, 1}, {-1, 0.5}};
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < chosen_.size(); ++k) {
      const Candidate& chosen = list_.candidates[chosen_[k]];
      if (chosen.axis == axis &&
          (is_step(chosen) || !chosen.effect->in_one("sensor.bias_step", any_train).empty()))
        found.push_back(k);
    }
    return found;
  }
  bool put_train_in_place_of(const std::vector<std::size_t>& instances, std::size_t axis) {
    constexpr double kRefined = 1.3;  // by which a train may gain more when its edges move
    const EnlargedFit without = fit_without(instances);
    if (!without.determined) return false;
    const auto comb = regular_steps(list_, responses(), without, axis);
    if (!comb) return false;
    const double looks = static_cast<double>(kAxisCount) * comb->looks;
    if (p_of_search(log_chi_squared_tail(kRefined * comb->gain, 1), looks) > options_.false_alarm)
      return false;
    const double size = comb->size, up_s = comb->first_up_s;
    return replace_in_one(
        instances, list_.candidates[comb->first_step],
        {{size, up_s}, {size, up_s + comb->period_s}, {-size, up_s + comb->width_s}}, looks);
  }

  /// One candidate in the place of the `instances` of the candidate `repeated`, whose parameters
  /// are `p`; of all that could be one, so many were looked at.
  bool replace_in_one(const std::vector<std::size_t>& instances, const Candidate& repeated,
                      const std::vector<std::vector<double>>& p, double looks) {
    const EnlargedFit without = fit_without(instances);
    if (!without.determined) return false;
    const Effect* tried = nullptr;
    std::optional<Exchange> best;
    double best_cost = stage_.fit.chi2 + price_of(instances);
    for (std::size_t c = 0; c < list_.candidates.size(); ++c) {
      const Candidate& candidate = list_.candidates[c];
      if (candidate.axis != repeated.axis || candidate.effect == tried) continue;
      tried = candidate.effect;
      CandidateList ones;
      for (const Hypothesis& hypothesis : tried->in_one(repeated.effect->id(), p))
        ones.candidates.push_back(
            {.effect = tried, .axis = candidate.axis, .hypothesis = hypothesis});
      for (const Candidate& one : likeliest(ones, without)) {
        const ActiveEffect active = one.active();
        const EnlargedFit with = fit_with(without.parameters, active);
        const auto dof = static_cast<int>(std::count(active.free.begin(), active.free.end(), true));
        const double cost = with.chi2 + price(c, dof);
        if (!with.determined || cost >= best_cost) continue;
        const double p_value = p_of_search(
            log_chi_squared_tail(without.chi2 - with.chi2, static_cast<double>(dof)), looks);
        if (p_value > options_.false_alarm) continue;
        best_cost = cost;
        best = {c, p_value, with.parameters};
      }
    }
    return best && exchange(instances, *best);
  }

  /// Those that gain most beside a fit to first order, best first.
  std::vector<Candidate> likeliest(const CandidateList& list, const EnlargedFit& fit) const {
    constexpr std::size_t kFew = 8;
    if (list.candidates.size() <= kFew) return list.candidates;
    const CandidateResponses beside =
        candidate_responses(input_.log, list, stage_.whitening, fit.parameters);
    const Eigen::VectorXd gains = CandidateGains(beside, fit).of(fit.whitened_residual);
    std::vector<std::size_t> order(list.candidates.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t k, std::size_t l) {
      return gains(static_cast<Eigen::Index>(k)) > gains(static_cast<Eigen::Index>(l));
    });
    std::vector<Candidate> few;
    for (std::size_t k = 0; k < kFew; ++k) few.push_back(list.candidates[order[k]]);
    return few;
  }

  int dof_of(std::size_t k) const {
    const auto& free = stage_.fit.parameters.effects[k].free;
    return static_cast<int>(std::count(free.begin(), free.end(), true));
  }

  /// Replaces one effect, or two, by a single one that explains as much for less. What was chosen
  /// first was chosen while the others were still missing.
  bool exchange_one() {
    if (chosen_.empty() || exchanges_ == kMostExchanges) return false;
    ++exchanges_;
    std::vector<std::vector<std::size_t>> subsets;
    for (std::size_t k = 0; k < chosen_.size(); ++k) subsets.push_back({k});
    for (std::size_t k = 0; k < chosen_.size(); ++k)
      for (std::size_t l = k + 1; l < chosen_.size(); ++l) subsets.push_back({k, l});
    std::erase_if(subsets, [&](const std::vector<std::size_t>& subset) {
      return std::any_of(subset.begin(), subset.end(),
                         [&](std::size_t k) { return is_certain(list_.candidates[chosen_[k]]); });
    });
    responses();
    std::vector<std::vector<Exchange>> exchanges(subsets.size());
    parallel_for(subsets.size(), [&](std::size_t s) { exchanges[s] = exchanges_for(subsets[s]); });
    for (std::size_t s = 0; s < subsets.size(); ++s) {
      for (const Exchange& with : exchanges[s])
        if (exchange(subsets[s], with)) return true;
    }
    return false;
  }

  /// One candidate in the place of some of the model's effects.
  struct Exchange {
    std::size_t candidate;
    double p;
    EnlargedParameters parameters;
  };

  /// Puts one candidate in the place of a subset, ascending, when its parameters are determined.
  bool exchange(const std::vector<std::size_t>& subset, const Exchange& with) {
    if (!adopt(with.parameters)) return false;
    for (auto k = subset.rbegin(); k != subset.rend(); ++k) forget(*k);
    choose(with.candidate, with.p);
    return true;
  }

  double price_of(const std::vector<std::size_t>& subset) const {
    double sum = 0;
    for (const std::size_t k : subset) sum += price(chosen_[k], std::max(1, dof_of(k)));
    return sum;
  }

  /// Those that are worth their price, likeliest first. Precondition: responses() is up to date.
  std::vector<Exchange> exchanges_for(const std::vector<std::size_t>& subset) const {
    constexpr std::size_t kRefined = 4;
    constexpr double kClearly = 2;
    std::vector<Exchange> exchanges;
    const EnlargedFit without = fit_without(subset);
    if (!without.determined) return exchanges;
    const double spent = price_of(subset);
    const CandidateGains gains(*responses_, without);
    const std::vector<Scored> ranked =
        screen(list_, gains, gains.of(without.whitened_residual).col(0));
    for (std::size_t r = 0; r < std::min(kRefined, ranked.size()); ++r) {
      const std::size_t index = ranked[r].candidate;
      const Candidate& candidate = list_.candidates[index];
      const Candidate& replaced = list_.candidates[chosen_[subset.front()]];
      if (subset.size() == 1 && candidate.family == replaced.family &&
          candidate.hypothesis.p == replaced.hypothesis.p)
        continue;
      if (is_chosen(candidate) && std::none_of(subset.begin(), subset.end(), [&](std::size_t k) {
            return list_.candidates[chosen_[k]].effect == candidate.effect;
          }))
        continue;
      const EnlargedFit with = fit_with(without.parameters, candidate.active());
      if (!with.determined) continue;
      const double cost = with.chi2 + price(index, std::max(1, gains.dof(index)));
      if (!(cost < stage_.fit.chi2 + spent - kClearly)) continue;
      const double p =
          p_of_search(log_p_of(index, without.chi2 - with.chi2, gains.dof(index), with), looks_);
      if (p <= options_.false_alarm) exchanges.push_back({index, p, with.parameters});
    }
    return exchanges;
  }

  SearchResult result() {
    SearchResult result;
    result.evidence.resize(chosen_.size());
    parallel_for(chosen_.size(), [&](std::size_t k) {
      const std::vector<bool>& free = stage_.fit.parameters.effects[k].free;
      const auto dof = std::max<std::ptrdiff_t>(1, std::count(free.begin(), free.end(), true));
      const double lost = fit_without({k}).chi2 - stage_.fit.chi2;
      result.evidence[k] = {list_.candidates[chosen_[k]], p_values_[k],
                            sigmas_of(log_chi_squared_tail(lost, static_cast<double>(dof)))};
    });
    responses();
    result.responses = std::move(*responses_);
    result.fit = std::move(stage_.fit);
    result.observed = std::move(stage_.observed);
    result.own_V2 = std::move(stage_.own_V2);
    result.coarse = stage_.coarse;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (stage_.crossing_V2[axis].size() > 0) result.own_V2[axis] += stage_.crossing_V2[axis];
    result.noise = std::move(stage_.noise);
    result.whitening = std::move(stage_.whitening);
    result.p_best_rest = p_best_rest_;
    return result;
  }

  static constexpr double kProven = 1e-300;  ///< what the codes prove needs no search
  static constexpr int kMostExchanges = 4;
  const SearchInput& input_;
  const CandidateList& list_;
  const SearchOptions& options_;
  Stage stage_;
  bool noise_is_own_ = false;  ///< of the stage: estimated beside its model and nothing else
  std::optional<CandidateResponses> responses_;
  std::vector<std::size_t> chosen_;  ///< candidates, in the order of the model's effects
  std::vector<double> p_values_;
  std::vector<std::size_t> dropped_;  ///< families
  double looks_ = 0;
  double p_best_rest_ = 1;
  int exchanges_ = 0;
  int trains_ = 0;  ///< looked for
};

}  // namespace

SearchResult search_effects(const SearchInput& input, const CandidateList& list,
                            const SearchOptions& options) {
  return Search(input, list, options).run();
}

}  // namespace plumbline
