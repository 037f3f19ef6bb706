#include "estimator/diagnosis/switching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/diagnosis/exchange.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/effects/listed_drivers.h"
#include "estimator/effects/telegraph.h"
#include "estimator/median.h"

namespace plumbline {

namespace {

const Telegraph* telegraph_of(const Candidate& candidate) {
  return dynamic_cast<const Telegraph*>(candidate.effect);
}

/// What a residual shows of one size that may differ from visit to visit: residual and the response
/// to size 1, both over the noise of the axis.
struct Trace {
  std::vector<Eigen::Vector3d> residual, response;

  std::size_t size() const { return residual.size(); }
  double cost(std::size_t visit, double level) const {
    return (residual[visit] - level * response[visit]).squaredNorm();
  }
};

/// Standard deviation of what the visits before do not tell of one, of most of them. Neither way is
/// sure: noise was estimated beside a model that is wrong, and what differs from one visit to the
/// next may be the effect.
double scatter_V(const SearchModel& model, std::size_t axis, const Eigen::VectorXd& residual_V) {
  std::vector<double> steps_V;
  for (Eigen::Index k = 1; k < residual_V.size(); ++k)
    steps_V.push_back(std::abs(residual_V(k) - residual_V(k - 1)));
  const Eigen::VectorXd sd_V = model.stage().whitening.lower(axis).diagonal();
  return std::min(median({sd_V.begin(), sd_V.end()}),
                  sd_of_distances(std::move(steps_V)) / std::sqrt(2.0));
}

/// Nothing where an axis shows no noise at all, or the term does nothing.
std::optional<Trace> trace_of(const SearchModel& model, const EnlargedFit& without,
                              const Candidate& candidate) {
  const VisitLog& log = model.input().log;
  // On all the time: it set in long before and never ends.
  ActiveEffect on = candidate.active();
  const auto switches = static_cast<std::size_t>(telegraph_of(candidate)->switches());
  for (std::size_t k = 0; k < switches; ++k)
    on.p[k] = (k == 0 ? -1 : 1) * std::numeric_limits<double>::max();
  const double size = on.p[switches];
  const auto off_V = predict_means_V(log, without.parameters);
  const auto on_V = predict_means_V(log, with_effect(without.parameters, on));
  Trace trace;
  trace.residual.assign(log.visits.size(), Eigen::Vector3d::Zero());
  trace.response.assign(log.visits.size(), Eigen::Vector3d::Zero());
  bool any = false;
  for (const std::size_t axis : axes_of(on)) {
    const Eigen::VectorXd residual_V = model.stage().observed.mean_V[axis] - off_V[axis];
    const double sd_V = scatter_V(model, axis, residual_V);
    if (!(sd_V > 0)) return {};
    const auto i = static_cast<Eigen::Index>(axis);
    for (std::size_t visit = 0; visit < trace.size(); ++visit) {
      const auto row = static_cast<Eigen::Index>(visit);
      trace.residual[visit](i) = residual_V(row) / sd_V;
      trace.response[visit](i) = (on_V[axis](row) - off_V[axis](row)) / (size * sd_V);
      any = any || trace.response[visit](i) != 0;
    }
  }
  if (!any) return {};
  return trace;
}

using Levels = std::array<double, 2>;
/// The level of each visit.
using States = std::vector<std::uint8_t>;

/// The likeliest states with these levels (Viterbi, 1967), where every switch costs so much.
States likeliest_states(const Trace& trace, const Levels& levels, double price) {
  std::vector<std::array<std::uint8_t, 2>> from(trace.size());
  std::array<double, 2> cost{};
  for (std::size_t visit = 0; visit < trace.size(); ++visit) {
    std::array<double, 2> next{};
    for (std::uint8_t state = 0; state < 2; ++state) {
      const auto other = static_cast<std::uint8_t>(1 - state);
      const bool switched = visit > 0 && cost[other] + price < cost[state];
      from[visit][state] = switched ? other : state;
      next[state] =
          (switched ? cost[other] + price : cost[state]) + trace.cost(visit, levels[state]);
    }
    cost = next;
  }
  States states(trace.size());
  std::uint8_t state = cost[1] < cost[0] ? 1 : 0;
  for (std::size_t visit = trace.size(); visit-- > 0;) {
    states[visit] = state;
    state = from[visit][state];
  }
  return states;
}

int switches_of(const States& states) {
  int switches = 0;
  for (std::size_t visit = 1; visit < states.size(); ++visit)
    switches += states[visit] != states[visit - 1] ? 1 : 0;
  return switches;
}

/// States and levels that suit each other, from these levels on.
struct Switching {
  States states;
  Levels levels{};
  double cost = std::numeric_limits<double>::infinity();
};
Switching settle_switching(const Trace& trace, Levels levels, double price) {
  constexpr int kRounds = 12;
  Switching found;
  for (int round = 0; round < kRounds; ++round) {
    States states = likeliest_states(trace, levels, price);
    if (states == found.states) break;
    found.states = std::move(states);
    Levels along{}, square{};
    for (std::size_t visit = 0; visit < trace.size(); ++visit) {
      along[found.states[visit]] += trace.residual[visit].dot(trace.response[visit]);
      square[found.states[visit]] += trace.response[visit].squaredNorm();
    }
    for (const std::size_t state : {0U, 1U})
      if (square[state] > 0) levels[state] = along[state] / square[state];
  }
  found.levels = levels;
  found.cost = price * switches_of(found.states);
  for (std::size_t visit = 0; visit < trace.size(); ++visit)
    found.cost += trace.cost(visit, levels[found.states[visit]]);
  return found;
}

/// The best of what comes of levels further and less far apart, the one, the other or neither of
/// them seldom.
Switching likeliest_switching(const Trace& trace) {
  double square = 0, beyond_noise = 0;
  for (std::size_t visit = 0; visit < trace.size(); ++visit) {
    const double along = trace.residual[visit].dot(trace.response[visit]);
    const double of_response = trace.response[visit].squaredNorm();
    if (!(of_response > 0)) continue;
    square += of_response;
    beyond_noise += along * along / of_response - 1;
  }
  const double size = std::sqrt(std::max(0.0, beyond_noise) / square);
  // Each of the switches lies between two of the visits.
  const double price = 2 * std::log(static_cast<double>(trace.size()));
  Switching best;
  for (const double apart : {0.7, 1.0, 1.5})
    for (const double middle : {-0.6, 0.0, 0.6}) {
      Switching found =
          settle_switching(trace, {(middle - apart) * size, (middle + apart) * size}, price);
      if (found.cost < best.cost) best = std::move(found);
    }
  return best;
}

/// When it switches: between two visits, or within the dwell of either, by how far that is on its
/// way from one level to the other.
std::vector<double> times_of_switches(const VisitLog& log, const Trace& trace,
                                      const Switching& found) {
  constexpr double kClearly = 6;  // in χ²: more than the choice of a place
  std::vector<double> times_s;
  for (std::size_t visit = 1; visit < trace.size(); ++visit) {
    const double was = found.levels[found.states[visit - 1]],
                 is = found.levels[found.states[visit]];
    if (found.states[visit] == found.states[visit - 1]) continue;
    const Visit &before = log.visits[visit - 1], &after = log.visits[visit];
    double time_s = 0.5 * (before.t_arrival_s + before.duration_s() + after.t_arrival_s);
    double most_gained = kClearly;
    for (const std::size_t within : {visit - 1, visit}) {
      const Eigen::Vector3d &residual = trace.residual[within], &response = trace.response[within];
      const double level = residual.dot(response) / response.squaredNorm();
      const double begun = (level - was) / (is - was);  // the share of the dwell after it
      if (!(begun > 0 && begun < 1)) continue;
      const double gained =
          trace.cost(within, within == visit ? is : was) - trace.cost(within, level);
      if (gained <= most_gained) continue;
      most_gained = gained;
      const Visit& dwell = log.visits[within];
      time_s = dwell.t_mean_s + (0.5 - begun) * dwell.duration_s();
    }
    times_s.push_back(time_s);
  }
  return times_s;
}

/// Whether it follows where the head is or was: in an order of poses what follows that may come and
/// go with the time.
bool follows_poses(const Candidate& candidate) {
  const auto* term = dynamic_cast<const SmoothTerm*>(candidate.effect);
  return term != nullptr && term->driver() != "t_s" && term->columns().empty();
}

bool follows_time(const Candidate& candidate) {
  if (const auto* term = dynamic_cast<const SmoothTerm*>(candidate.effect))
    return term->driver() == "t_s";
  const auto listed = drivers_of(*candidate.effect, candidate.axis);
  return listed && std::count(listed->drivers.begin(), listed->drivers.end(), "t_s") > 0;
}

/// What such a candidate may take the place of: what follows the time on the same axis, or of the
/// head, if these are several; all but what follows the poses.
std::vector<std::vector<std::size_t>> replaceable(const SearchModel& model,
                                                  const Candidate& candidate) {
  constexpr std::size_t kSeveral = 3, kMany = 4;
  std::vector<std::size_t> of_time, all;
  bool switches = false;  // already, and perhaps at other times
  for (std::size_t k = 0; k < model.size(); ++k) {
    const Candidate& chosen = model.candidate(k);
    const bool same =
        chosen.effect->subject() == candidate.effect->subject() && chosen.axis == candidate.axis;
    if (!same || model.is_certain(chosen) || follows_poses(chosen)) continue;
    all.push_back(k);
    switches = switches || telegraph_of(chosen) != nullptr;
    if (follows_time(chosen)) of_time.push_back(k);
  }
  const bool many = of_time.size() >= kSeveral || (!of_time.empty() && all.size() >= kMany);
  if (!many && !switches) return {};
  std::vector<std::vector<std::size_t>> subsets = {of_time};
  if (all.size() > of_time.size()) subsets.push_back(all);
  return subsets;
}

/// That candidate of the same that switches so often.
std::optional<std::size_t> with_switches(const CandidateList& list, const Candidate& candidate,
                                         std::size_t switches) {
  const Telegraph& like = *telegraph_of(candidate);
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Telegraph* other = telegraph_of(list.candidates[c]);
    if (other != nullptr && list.candidates[c].axis == candidate.axis && other->is_like(like) &&
        static_cast<std::size_t>(other->switches()) == switches)
      return c;
  }
  return {};
}

/// A switching that explains as much as a subset of the model's effects for less.
struct Proposal {
  std::vector<std::size_t> subset;
  SearchModel::Entry entry;
  double saved = 0;  ///< in χ² and prices
};
/// `without`: the fit without that subset.
std::optional<Proposal> switching_for(const SearchModel& model, const Candidate& candidate,
                                      const std::vector<std::size_t>& subset,
                                      const EnlargedFit& without) {
  if (!without.determined) return {};
  const auto trace = trace_of(model, without, candidate);
  if (!trace) return {};
  const Switching found = likeliest_switching(*trace);
  Hypothesis hypothesis{times_of_switches(model.input().log, *trace, found)};
  const auto index = with_switches(model.list(), candidate, hypothesis.p.size());
  if (!index) return {};
  const Candidate& switching = model.list().candidates[*index];
  hypothesis.p.push_back(found.levels[1 - found.states.front()] -
                         found.levels[found.states.front()]);
  const EnlargedFit with =
      model.fit_with(without.parameters, switching.with(std::move(hypothesis)).active());
  if (!with.determined) return {};
  const double saved =
      model.stage().fit.chi2 + model.price_of(subset) - with.chi2 - model.price_in(with, *index);
  const double log_p =
      model.log_p_of(*index, without, with, 1) + telegraph_of(switching)->log_choices();
  const double p = model.p_of(switching, std::min(0.0, log_p));
  if (saved < kWorthExchanging || p > model.false_alarm(switching)) return {};
  return Proposal{subset, {*index, p, with.parameters}, saved};
}

}  // namespace

bool tell_by_switching(SearchModel& model) {
  std::vector<Proposal> proposals;
  std::map<std::vector<std::size_t>, EnlargedFit> without;  // the same for bias and scale, say
  for (const Candidate& candidate : model.list().candidates) {
    const Telegraph* telegraph = telegraph_of(candidate);
    if (telegraph == nullptr || telegraph->switches() != Telegraph::kFewest) continue;
    for (const std::vector<std::size_t>& subset : replaceable(model, candidate)) {
      auto fit = without.find(subset);
      if (fit == without.end()) fit = without.emplace(subset, model.fit_without(subset)).first;
      if (auto proposal = switching_for(model, candidate, subset, fit->second))
        proposals.push_back(*std::move(proposal));
    }
  }
  std::stable_sort(proposals.begin(), proposals.end(),
                   [](const Proposal& a, const Proposal& b) { return a.saved > b.saved; });
  return std::any_of(proposals.begin(), proposals.end(), [&](const Proposal& proposal) {
    return exchange_in_own_noise(model, proposal.subset, {proposal.entry}, 0);
  });
}

}  // namespace plumbline
