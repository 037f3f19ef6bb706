#include "estimator/diagnosis/search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "estimator/diagnosis/exchange.h"
#include "estimator/diagnosis/naming.h"
#include "estimator/diagnosis/repetition.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/diagnosis/search_model.h"
#include "estimator/diagnosis/slow_look.h"
#include "estimator/diagnosis/switching.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

/// Forward selection and what follows it.
class Search {
 public:
  Search(const SearchInput& input, const CandidateList& list, const SearchOptions& options)
      : input_(input), list_(list), options_(options), model_(input, list, options) {}

  SearchResult run() {
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (!has_lattice(axis)) adopt_all_proven(axis);
    const SearchModel start = model_;
    explain_residual();
    for (const std::size_t first : other_ways_in(start)) try_beginning_with(first, start);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (has_lattice(axis)) adopt_lattice(axis);
    SearchResult result = model_.take_result();
    result.p_best_rest = p_best_rest_;
    return result;
  }

 private:
  /// False where it came to what another way had come to before: from there on they are one.
  bool explain_residual() {
    if (!grow()) return false;
    constexpr int kMostNamings = 3;
    for (int k = 0; k < kMostNamings && name_unlisted(model_); ++k) {
      model_.drop_superfluous();
      if (!grow()) return false;
    }
    constexpr int kMostExchanges = 4;
    for (int k = 0; k < kMostExchanges && (exchange_for_one_kind(model_) || exchange_one(model_));
         ++k)
      model_.drop_superfluous();
    model_.drop_what_excess_explains();
    return true;
  }

  /// What comes first may stand for something else, and functions without a name then make up for
  /// the difference. Where there are several of them, what else the search may begin with: the
  /// likeliest of what moves the head, and of what has a name.
  std::vector<std::size_t> other_ways_in(SearchModel start) const {
    std::size_t unnamed = 0;
    for (std::size_t k = 0; k < model_.size(); ++k)
      unnamed += model_.candidate(k).has_name() ? 0 : 1;
    std::vector<std::size_t> ways;
    if (unnamed < 2) return ways;
    const CandidateGains gains(start.responses(), start.stage().fit);
    const std::vector<std::size_t> in_model = families();
    bool has_head = false, has_named = false;
    for (const Scored& s : screen(list_, gains, gains.of_residual())) {
      const Candidate& c = list_.candidates[s.candidate];
      if (std::binary_search(in_model.begin(), in_model.end(), c.family) || start.is_chosen(c))
        continue;
      const bool first_of_head = !has_head && c.effect->subject() == Subject::head;
      const bool first_named = !has_named && c.has_name();
      if (first_of_head || first_named) ways.push_back(s.candidate);
      has_head = has_head || first_of_head;
      has_named = has_named || first_named;
    }
    return ways;
  }

  /// Keeps what comes of it if that is clearly the likelier, at its price.
  void try_beginning_with(std::size_t first, const SearchModel& start) {
    constexpr double kClearly = 10;  // of −2 ln L
    constexpr PerAxis<bool> kAll{true, true, true};
    const SearchModel before = std::exchange(model_, start);
    const double p_before = p_best_rest_;
    passed_before_.merge(passed_);
    model_.set_looks(before.looks());
    const Candidate& candidate = list_.candidates[first];
    const ActiveEffect active = candidate.active();
    const EnlargedFit& alone = model_.stage().fit;
    const EnlargedFit with = model_.fit_with(alone.parameters, active);
    if (with.determined) {
      const double log_p =
          model_.log_p_of(first, alone, with, static_cast<int>(active.free_count()));
      if (model_.add({first, model_.p_of(candidate, log_p), with.parameters}) &&
          explain_residual() &&
          model_.cost(before.stage(), kAll) < before.cost(before.stage(), kAll) - kClearly)
        return;
    }
    model_ = before;
    p_best_rest_ = p_before;
  }

  bool has_lattice(std::size_t axis) const {
    return input_.log.codes[axis].coarser_lattice.has_value();
  }

  /// A coarser lattice joins last. Until then the readings are freed of rounding to it, but only as
  /// well as noise smooths its steps, and effects may stand for what is left: they go where the
  /// lattice without them costs less.
  void adopt_lattice(std::size_t axis) {
    std::vector<std::size_t> beside;
    for (std::size_t k = 0; k < model_.size(); ++k)
      if (model_.candidate(k).effect->subject() == Subject::sensor &&
          model_.candidate(k).axis == axis)
        beside.push_back(k);
    std::optional<SearchModel> freed;
    if (!beside.empty()) freed = model_;
    adopt_all_proven(axis);
    if (!freed || !freed->drop(beside)) return;
    const SearchModel with = std::exchange(model_, *std::move(freed));
    adopt_all_proven(axis);
    PerAxis<bool> here{};
    here[axis] = true;
    if (model_.size() + beside.size() != with.size() ||
        model_.cost(with.stage(), here) > with.cost(with.stage(), here))
      model_ = with;
  }

  /// One effect after the other, until nothing is found. False as explain_residual().
  bool grow() {
    // Where the best of the slow ones is superfluous as soon as it is there, so are the others.
    bool worth_slow_look = true;
    // A train that takes the place of another could be followed by that again.
    constexpr int kMostTrains = 6;
    int trains = 0;  // looked for
    // Each exchange is judged in the noise beside the model as it then is, so that two may take
    // each other's place for ever.
    constexpr int kMostReturns = 3;
    std::map<std::vector<std::size_t>, int> returns;
    while (model_.size() < options_.max_effects && returns[families()]++ <= kMostReturns) {
      if (passed_before_.contains(families())) return false;
      passed_.insert(families());
      const std::size_t before = model_.size();
      const bool found = add_one();
      if (!found && !(worth_slow_look && add_slow_one()) &&
          !(trains++ < kMostTrains && add_train(model_)))
        break;
      if (found) exchange_slow(model_, model_.size() - 1);
      model_.drop_superfluous();
      tell_in_one(model_);
      tell_by_switching(model_);
      if (!found) worth_slow_look = model_.size() > before;
    }
    return true;
  }

  /// Of the effects in the model, in ascending order.
  std::vector<std::size_t> families() const {
    std::vector<std::size_t> all;
    for (std::size_t k = 0; k < model_.size(); ++k) all.push_back(model_.candidate(k).family);
    std::sort(all.begin(), all.end());
    return all;
  }

  /// What the codes of an axis prove.
  void adopt_all_proven(std::size_t axis) {
    for (std::size_t c = 0; c < list_.candidates.size(); ++c) {
      const Candidate& candidate = list_.candidates[c];
      if (candidate.axis == axis && model_.is_certain(candidate) && !is_proven_otherwise(candidate))
        adopt_proven(c);
    }
  }
  /// What the codes prove joins the model, also where noise smooths its steps so much that the
  /// readings say nothing of a shape.
  void adopt_proven(std::size_t candidate) {
    const ActiveEffect proven = list_.candidates[candidate].active();
    Observations observed = model_.stage().observed;
    observed.mean_V[proven.axis] = input_.observed.mean_V[proven.axis];  // freed of what now joins
    for (const ActiveEffect& active : {proven, with_shapes_held(proven)}) {
      const EnlargedFit with = fit_from_levels(input_.log, observed, model_.stage().whitening,
                                               with_effect(model_.stage().fit.parameters, active));
      if (with.determined && model_.add({candidate, kProven, with.parameters})) return;
    }
  }
  /// Two effects that the codes of an axis prove are two names for one.
  bool is_proven_otherwise(const Candidate& candidate) const {
    for (std::size_t k = 0; k < model_.size(); ++k) {
      const Candidate& chosen = model_.candidate(k);
      if (chosen.axis == candidate.axis && chosen.effect != candidate.effect &&
          model_.is_certain(chosen))
        return true;
    }
    return false;
  }

  /// Adds the best candidate if the search as a whole would not often find as much in noise.
  bool add_one() {
    const CandidateGains gains(model_.responses(), model_.stage().fit);
    const Eigen::VectorXd& first_order = gains.of_residual();
    std::vector<Scored> ranked = screen(list_, gains, first_order);
    // The number of looks hardly changes while the model grows.
    if (model_.looks() == 0)
      model_.set_looks(effective_looks(gains, list_.candidates.size(),
                                       model_.stage().fit.whitened_residual.size(), options_.seed,
                                       options_.replicates));
    std::erase_if(ranked, [&](const Scored& s) {
      const Candidate& c = list_.candidates[s.candidate];
      const double false_alarm = model_.false_alarm(c);
      return model_.is_dropped(c) || model_.is_chosen(c) ||
             (false_alarm < options_.false_alarm && model_.p_of(c, s.log_p) > false_alarm);
    });
    for (Scored& s : ranked)
      s.score += std::log(model_.looks_of(list_.candidates[s.candidate]) / model_.looks());
    std::stable_sort(ranked.begin(), ranked.end(),
                     [](const Scored& a, const Scored& b) { return a.score < b.score; });
    if (ranked.empty()) return false;
    p_best_rest_ = 1;
    bool any_significant = false;
    for (const Scored& s : ranked) {
      const Candidate& c = list_.candidates[s.candidate];
      const double p = model_.p_of(c, s.log_p);
      p_best_rest_ = std::min(p_best_rest_, p);
      any_significant = any_significant || p <= model_.false_alarm(c);
    }
    if (!any_significant) return false;

    // First order ranks; the full response decides.
    constexpr std::size_t kRefined = 10;
    std::vector<EnlargedFit> fits(std::min(kRefined, ranked.size()));
    parallel_for(fits.size(), [&](std::size_t k) {
      const std::size_t candidate = ranked[k].candidate;
      fits[k] = model_.fit_with(gains, candidate, list_.candidates[candidate],
                                first_order(static_cast<Eigen::Index>(candidate)));
    });
    const Scored* winner = nullptr;
    EnlargedParameters with_winner;
    double winner_score = std::numeric_limits<double>::infinity(), winner_log_p = 0;
    for (std::size_t k = 0; k < fits.size(); ++k) {
      const Scored& s = ranked[k];
      const EnlargedFit& with = fits[k];
      if (!with.determined) continue;
      const double log_p =
          model_.log_p_of(s.candidate, model_.stage().fit, with, gains.dof(s.candidate));
      const double score = log_p + (s.score - s.log_p);
      // Of two that say the same of these readings, the first of the list: the simpler.
      constexpr double kSame = 1e-3;
      const double ahead = winner_score - score;
      if (ahead > kSame || (ahead > -kSame && s.candidate < winner->candidate)) {
        winner = &s;
        with_winner = with.parameters;
        winner_score = score;
        winner_log_p = log_p;
      }
    }
    std::vector<std::size_t> overlapping;  // and likelier than the winner
    for (std::size_t k = 0; k < fits.size(); ++k)
      if (!fits[k].determined && (winner == nullptr || ranked[k].score < winner->score))
        overlapping.push_back(ranked[k].candidate);
    if (replace_overlapping(overlapping, gains)) return true;
    if (winner == nullptr) return false;
    const Candidate& won = list_.candidates[winner->candidate];
    const double p = model_.p_of(won, winner_log_p);
    if (p > model_.false_alarm(won)) return false;
    if (!model_.noise_is_own() &&
        !stands_beside_slow_noise(won, with_winner, gains.dof(winner->candidate)))
      return model_.take_own_noise() && add_one();
    if (!won.has_name() && add_special_case(winner->candidate, gains, first_order)) return true;
    return model_.add({winner->candidate, p, with_winner});
  }

  /// Whether the readings are clearly likelier with the newcomer where it is slow and what it does
  /// may as well be slow noise, of which noise that was estimated beside more has too little.
  bool stands_beside_slow_noise(const Candidate& newcomer, const EnlargedParameters& with,
                                int dof) const {
    if (!may_be_slow_noise(input_, with)) return true;
    const Stage& stage = model_.stage();
    const double log_p =
        log_p_in_own_noise(input_, with, stage.fit.parameters, newcomer.axis, dof, stage);
    return model_.p_of(newcomer, log_p) <= model_.false_alarm(newcomer);
  }

  /// Where a term without a name holds one with a name as a special case that does nearly as much,
  /// that one comes first: what is left may be something else.
  bool add_special_case(std::size_t general, const CandidateGains& gains,
                        const Eigen::VectorXd& first_order) {
    constexpr double kNearly = 0.9;
    for (const std::size_t c : special_cases(model_.responses(), model_.stage().fit, general)) {
      const Candidate& special = list_.candidates[c];
      const double promised = first_order(static_cast<Eigen::Index>(c));
      if (!special.has_name() || model_.is_dropped(special) || model_.is_chosen(special) ||
          promised < kNearly * first_order(static_cast<Eigen::Index>(general)))
        continue;
      const EnlargedFit with = model_.fit_with(gains, c, special, promised);
      if (!with.determined) continue;
      const double p =
          model_.p_of(special, model_.log_p_of(c, model_.stage().fit, with, gains.dof(c)));
      if (p <= model_.false_alarm(special) && model_.add({c, p, with.parameters})) return true;
    }
    return false;
  }

  /// A slow effect that the noise was estimated without is partly taken for slow noise, and then
  /// hides in it. Looked for where the noise is clearly smaller beside few functions of time, and
  /// where there is noise to hide in, beside any course of time.
  bool add_slow_one() {
    constexpr double kWorthALook = 1e-3;
    if (add_slow_one(slow_functions(input_.log), {true, true, true}, kWorthALook)) return true;
    PerAxis<bool> slow_noise{};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      slow_noise[axis] = has_slow_noise(input_, model_.stage(), axis);
    if (slow_noise == PerAxis<bool>{}) return false;
    // So many functions are seldom better as a whole, even if one of them is the truth.
    return add_slow_one(any_course_of_time(input_.log), slow_noise, 1);
  }

  bool add_slow_one(const Eigen::MatrixXd& beside, const PerAxis<bool>& axes, double worth_a_look) {
    const auto is_open = [&](const Candidate& c) {
      return !model_.is_dropped(c) && !model_.is_chosen(c);
    };
    const auto found =
        look_among_slow(input_, list_, model_.stage(), model_.noise_is_own(),
                        {beside, axes, worth_a_look, model_.false_alarm_of_slow(), is_open,
                         [this](const Candidate& c) { return model_.is_on_another_axis(c); }});
    if (!found) return false;
    p_best_rest_ = std::min(p_best_rest_, found->p_value);
    return found->significant && model_.add({found->candidate, found->p_value, found->model});
  }

  /// A term that holds one of the model's effects as a special case cannot stand beside it: it
  /// takes its place.
  bool replace_overlapping(const std::vector<std::size_t>& candidates,
                           const CandidateGains& gains) {
    constexpr std::size_t kMost = 3;
    for (std::size_t c = 0; c < std::min(kMost, candidates.size()); ++c) {
      const std::size_t candidate = candidates[c];
      for (std::size_t k = 0; k < model_.size(); ++k) {
        const EnlargedFit with = model_.fit_with(without_effect(model_.stage().fit.parameters, k),
                                                 list_.candidates[candidate].active());
        if (!with.determined || with.chi2 + model_.price_in(with, candidate) >
                                    model_.stage().fit.chi2 + model_.price_of({k}))
          continue;
        const Candidate& newcomer = list_.candidates[candidate];
        const double p = model_.p_of(
            newcomer, model_.log_p_of(candidate, model_.stage().fit, with, gains.dof(candidate)));
        if (p <= model_.false_alarm(newcomer) &&
            model_.exchange({k}, {candidate, p, with.parameters}))
          return true;
      }
    }
    return false;
  }

  const SearchInput& input_;
  const CandidateList& list_;
  const SearchOptions& options_;
  SearchModel model_;
  double p_best_rest_ = 1;
  /// Families of the models that the search has come through, on this way and on those before.
  std::set<std::vector<std::size_t>> passed_, passed_before_;
};

}  // namespace

SearchResult search_effects(const SearchInput& input, const CandidateList& list,
                            const SearchOptions& options) {
  return Search(input, list, options).run();
}

}  // namespace plumbline
