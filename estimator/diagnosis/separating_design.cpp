#include "estimator/diagnosis/separating_design.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <tuple>
#include <utility>

#include "estimator/effects/smooth_term.h"
#include "estimator/median.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

using Stop = SeparatingPlan::Stop;
using Eigen::Index;

constexpr double kRegular = 1e-10;  ///< of information that is scaled to a unit diagonal
constexpr std::size_t kLengths[] = {6, 12, 24, 48, 96};
constexpr double kDelta_step_deg = 15;  ///< not a multiple of the usual 10°: aliases differ
constexpr double kH_step_deg = 10;

/// The run with stops after it, as the sequencer would go on.
VisitLog extended(const VisitLog& log, const std::vector<Stop>& stops, double samples_factor) {
  VisitLog longer = log;
  const Visit& first = log.visits.front();
  const double n = static_cast<double>(log.visits.size());
  const double dwell_s = first.duration_s();
  const double cycle_s = std::max((log.last_s() - log.first_s()) / std::max(n - 1, 1.0), dwell_s);
  const auto count =
      static_cast<std::size_t>(std::lround(static_cast<double>(first.count) * samples_factor));
  for (const Stop& stop : stops) {
    const Visit before = longer.visits.back();
    Visit visit = before;
    visit.delta_rad = stop.delta_deg * kRadPerDeg;
    visit.h_rad = stop.h_deg * kRadPerDeg;
    visit.count = count;
    visit.step_s = first.step_s;
    const double longer_s =
        first.step_s * (static_cast<double>(count) - static_cast<double>(first.count));
    visit.t_arrival_s = before.t_arrival_s + cycle_s + std::max(longer_s, 0.0);
    visit.t_mean_s = visit.t_arrival_s + 0.5 * first.step_s * (static_cast<double>(count) - 1);
    visit.delta_direction = direction_after(before, visit.delta_rad);
    if (!longer.contrasts.contains(count))
      longer.contrasts.emplace(count, contrasts_of(visit, log));
    longer.visits.push_back(std::move(visit));
  }
  return longer;
}

bool has_smooth_term(const EnlargedParameters& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const ActiveEffect& active) {
    return dynamic_cast<const SmoothTerm*>(active.effect) != nullptr;
  });
}

/// The model with `terms` in place of its own smooth terms, which know the visits of their log
/// only.
EnlargedParameters with_terms(const std::vector<std::unique_ptr<SmoothTerm>>& terms,
                              EnlargedParameters model) {
  for (ActiveEffect& active : model.effects) {
    const auto* own = dynamic_cast<const SmoothTerm*>(active.effect);
    if (own == nullptr) continue;
    if (const SmoothTerm* term =
            find_term(terms, own->driver(), to_string(own->form()), own->shape()))
      active.effect = term;
  }
  return model;
}

/// Rows of the visits from `first` on, in units of their noise: the means, then, where something
/// happens within the dwell, its contrasts.
class NewRows {
 public:
  NewRows(const PoseWhitening& whitening, Index first, double samples_factor, bool within_dwell)
      : first_(first), contrasts_(within_dwell ? whitening.dwell_sd_V[0].size() : 0) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      // What a pose has for itself once the slow noise is known from its neighbours.
      std::vector<double> own(static_cast<std::size_t>(whitening.lower(i).rows()));
      Eigen::Map<Eigen::VectorXd>(own.data(), std::ssize(own)) = whitening.lower(i).diagonal();
      mean_sd_V_[i] = median(std::move(own)) / std::sqrt(std::clamp(samples_factor, 1.0, 2.0));
      dwell_sd_V_[i] = whitening.dwell_sd_V[i];
    }
  }
  /// 3 + 3·contrasts, those of one visit together.
  Index per_visit() const { return 3 * (1 + contrasts_); }
  Eigen::VectorXd of(const VisitLog& log, const EnlargedParameters& model) const {
    const auto mean_V = predict_means_V(log, model);
    const auto dwell_V = contrasts_ > 0 ? predict_dwells_V(log, model) : PerAxis<Eigen::MatrixXd>{};
    const Index count = std::ssize(log.visits) - first_;
    Eigen::VectorXd rows(per_visit() * count);
    Index at = 0;
    for (Index k = first_; k < first_ + count; ++k) {
      for (std::size_t i = 0; i < kAxisCount; ++i) rows(at++) = mean_V[i](k) / mean_sd_V_[i];
      for (std::size_t i = 0; i < kAxisCount; ++i)
        for (Index d = 0; d < contrasts_; ++d) rows(at++) = dwell_V[i](k, d) / dwell_sd_V_[i](d);
    }
    return rows;
  }

 private:
  Index first_, contrasts_;
  PerAxis<double> mean_sd_V_{};
  PerAxis<Eigen::VectorXd> dwell_sd_V_;
};

/// A rival on its way through further poses: what is left between it and the found effect.
struct Contest {
  const EnlargedParameters* rival = nullptr;
  Eigen::VectorXd scale;        ///< of the rival's parameters
  Eigen::MatrixXd information;  ///< scaled, of the run
  Eigen::VectorXd slope;        ///< scaled
  double square = 0;

  double distance(const Eigen::MatrixXd& M, const Eigen::VectorXd& g, double s) const {
    Eigen::MatrixXd regular = M;
    regular.diagonal().array() += kRegular;
    return std::max(s - g.dot(regular.ldlt().solve(g)), 0.0);
  }
};

/// Rows of the further visits: difference of the models, and the rival's (scaled) Jacobian.
struct Rows {
  Eigen::VectorXd difference;
  Eigen::MatrixXd jacobian;
};

Eigen::MatrixXd numeric_rows(const VisitLog& log, const NewRows& rows,
                             const EnlargedParameters& model, const Eigen::VectorXd& scale) {
  const Eigen::VectorXd centre = model.free_values();
  Eigen::MatrixXd jacobian;
  for (Index j = 0; j < centre.size(); ++j) {
    // A hundredth of what the run knows of the parameter, felt in the prediction all the same.
    const double step = std::max(1e-2 * scale(j), 1e-9);
    const auto moved = [&](double by) {
      EnlargedParameters other = model;
      Eigen::VectorXd values = centre;
      values(j) += by;
      other.set_free_values(values);
      return rows.of(log, other);
    };
    const Eigen::VectorXd column = (moved(step) - moved(-step)) * (scale(j) / (2 * step));
    if (j == 0) jacobian.resize(column.size(), centre.size());
    jacobian.col(j) = column;
  }
  return jacobian;
}

class Design {
 public:
  Design(const SearchInput& input, const SearchResult& result,
         const std::vector<Alternative>& rivals)
      : log_(input.log),
        result_(result),
        within_dwell_(has_effect_within_dwell(result.fit.parameters)),
        smooth_terms_(has_smooth_term(result.fit.parameters)) {
    const Eigen::VectorXd found_V = predict_stacked_V(log_, result.fit.parameters);
    for (const Alternative& rival : rivals) {
      Contest contest;
      contest.rival = &rival.fit.parameters;
      within_dwell_ = within_dwell_ || has_effect_within_dwell(rival.fit.parameters);
      smooth_terms_ = smooth_terms_ || has_smooth_term(rival.fit.parameters);
      contest.scale = rival.fit.whitened_jacobian.colwise().norm().cwiseInverse();
      const Eigen::MatrixXd J = rival.fit.whitened_jacobian * contest.scale.asDiagonal();
      const Eigen::VectorXd difference =
          result.whitening.apply(found_V - predict_stacked_V(log_, *contest.rival));
      contest.information = J.transpose() * J;
      contest.slope = J.transpose() * difference;
      contest.square = difference.squaredNorm();
      contests_.push_back(std::move(contest));
    }
  }

  NewRows new_rows(double samples_factor) const {
    return {result_.whitening, std::ssize(log_.visits), samples_factor, within_dwell_};
  }

  std::vector<Rows> rows(const std::vector<Stop>& stops, double samples_factor) const {
    const VisitLog log = extended(log_, stops, samples_factor);
    const NewRows rows = new_rows(samples_factor);
    std::vector<std::unique_ptr<SmoothTerm>> terms;
    if (smooth_terms_) terms = smooth_terms(log, SmoothTermSelection::any);
    const Eigen::VectorXd expected = rows.of(log, with_terms(terms, result_.fit.parameters));
    std::vector<Rows> all(contests_.size());
    parallel_for(contests_.size(), [&](std::size_t r) {
      const Contest& contest = contests_[r];
      const EnlargedParameters rival = with_terms(terms, *contest.rival);
      all[r] = {expected - rows.of(log, rival), numeric_rows(log, rows, rival, contest.scale)};
    });
    return all;
  }

  /// Squared distances after the first `count` of the stops, one per rival.
  std::vector<double> distances(const std::vector<Rows>& rows, std::size_t count) const {
    std::vector<double> result;
    const Index used = new_rows(1).per_visit() * static_cast<Index>(count);
    for (std::size_t r = 0; r < contests_.size(); ++r) {
      const auto J = rows[r].jacobian.topRows(used);
      const auto d = rows[r].difference.head(used);
      result.push_back(contests_[r].distance(contests_[r].information + J.transpose() * J,
                                             contests_[r].slope + J.transpose() * d,
                                             contests_[r].square + d.squaredNorm()));
    }
    return result;
  }

  /// The stops that tell most, one after the other, from what can be visited; fewer than `count`
  /// where those settle everything.
  std::vector<Stop> greedy(const std::vector<Stop>& possible, std::size_t count) const {
    const std::vector<Rows> all = rows(possible, 1);
    const Index per_visit = new_rows(1).per_visit();
    std::vector<Contest> state = contests_;
    std::vector<Eigen::MatrixXd> means(state.size());  // rows of the means alone rank
    for (std::size_t r = 0; r < state.size(); ++r) {
      means[r].resize(3 * std::ssize(possible), all[r].jacobian.cols());
      for (Index k = 0; k < std::ssize(possible); ++k)
        means[r].middleRows<3>(3 * k) = all[r].jacobian.middleRows<3>(per_visit * k);
    }
    std::vector<Stop> chosen;
    while (chosen.size() < count) {
      std::vector<double> worth(possible.size(), 0);
      for (std::size_t r = 0; r < state.size(); ++r) {
        Eigen::MatrixXd M = state[r].information;
        M.diagonal().array() += kRegular;
        const Eigen::LDLT<Eigen::MatrixXd> ldlt(M);
        const Eigen::VectorXd estimate = ldlt.solve(state[r].slope);
        if (state[r].square - state[r].slope.dot(estimate) > 2 * kDecided) continue;
        const Eigen::VectorXd left = all[r].difference - all[r].jacobian * estimate;
        const Eigen::MatrixXd spread = ldlt.solve(means[r].transpose());
        for (std::size_t k = 0; k < possible.size(); ++k) {
          const auto at = static_cast<Index>(k);
          const Eigen::Matrix3d V = Eigen::Matrix3d::Identity() +
                                    means[r].middleRows<3>(3 * at) * spread.middleCols<3>(3 * at);
          const Eigen::Vector3d d = left.segment<3>(per_visit * at);
          worth[k] += d.dot(V.ldlt().solve(d));
        }
      }
      const auto best =
          static_cast<std::size_t>(std::max_element(worth.begin(), worth.end()) - worth.begin());
      if (!(worth[best] > 1e-6)) break;
      chosen.push_back(possible[best]);
      const Index at = per_visit * static_cast<Index>(best);
      for (std::size_t r = 0; r < state.size(); ++r) {
        const auto J = all[r].jacobian.middleRows(at, per_visit);
        const auto d = all[r].difference.segment(at, per_visit);
        state[r].information += J.transpose() * J;
        state[r].slope += J.transpose() * d;
        state[r].square += d.squaredNorm();
      }
    }
    return chosen;
  }

  std::size_t rivals() const { return contests_.size(); }

 private:
  const VisitLog& log_;
  const SearchResult& result_;
  bool within_dwell_ = false;
  bool smooth_terms_ = false;  ///< any of the models has some
  std::vector<Contest> contests_;
};

std::vector<Stop> within(const HeadReach& reach) {
  const double bottom_deg = std::ceil(std::max(reach.h_min_deg, -90.0) / kH_step_deg) * kH_step_deg;
  const double first_deg = std::ceil(reach.delta_min_deg / kDelta_step_deg) * kDelta_step_deg;
  const auto count = [](double first, double last, double step) {
    return static_cast<int>(std::floor((last - first) / step + 1e-9)) + 1;
  };
  const int rings = count(bottom_deg, std::min(reach.h_max_deg, 90.0), kH_step_deg);
  const int in_ring =
      count(first_deg, std::min(reach.delta_max_deg, reach.delta_min_deg + 345), kDelta_step_deg);
  std::vector<Stop> stops;
  for (int ring = 0; ring < rings; ++ring)
    for (int k = 0; k < in_ring; ++k)
      stops.push_back({first_deg + k * kDelta_step_deg, bottom_deg + ring * kH_step_deg});
  return stops;
}

/// As many of the stops in random order, each at a height of its own: what remembers where the head
/// came from may differ only after short ways.
std::vector<Stop> at_random(std::vector<Stop> stops, std::size_t most) {
  std::mt19937_64 random(1);
  // std::shuffle may differ between libraries; this does not.
  for (std::size_t k = stops.size(); k-- > 1;) std::swap(stops[k], stops[random() % (k + 1)]);
  if (stops.size() > most) stops.resize(most);
  const auto [low, high] = std::minmax_element(
      stops.begin(), stops.end(), [](const Stop& a, const Stop& b) { return a.h_deg < b.h_deg; });
  const double bottom_deg = low->h_deg;
  const auto whole_degrees = static_cast<std::uint64_t>(high->h_deg - bottom_deg) + 1;
  for (Stop& stop : stops) stop.h_deg = bottom_deg + static_cast<double>(random() % whole_degrees);
  return stops;
}

/// Ring by ring, to and fro.
void sort_for_travel(std::vector<Stop>& stops) {
  std::sort(stops.begin(), stops.end(), [](const Stop& a, const Stop& b) {
    if (a.h_deg != b.h_deg) return a.h_deg < b.h_deg;
    const bool backwards = std::lround(a.h_deg / kH_step_deg) % 2 != 0;
    return backwards ? a.delta_deg > b.delta_deg : a.delta_deg < b.delta_deg;
  });
}

}  // namespace

Proposal best_proposal(const SearchInput& input, const SearchResult& result,
                       const std::vector<Alternative>& rivals, const HeadReach& reach) {
  const Design design(input, result, rivals);
  const std::vector<Stop> possible = within(reach);
  constexpr std::size_t kMost = kLengths[std::size(kLengths) - 1];
  Proposal best;
  best.distance.assign(design.rivals(), 0);
  std::vector<double> most(design.rivals(), 0);
  best.most = most;
  if (possible.size() < 2) return best;
  const auto consider = [&](std::vector<Stop> stops, std::size_t length, double samples_factor,
                            const char* how, const std::vector<Rows>& rows) {
    Proposal trial;
    trial.distance = design.distances(rows, length);
    for (std::size_t r = 0; r < most.size(); ++r) most[r] = std::max(most[r], trial.distance[r]);
    if (trial.decided() < best.decided()) return;
    if (trial.decided() == best.decided() && !best.stops.empty() && length >= best.stops.size())
      return;
    if (trial.decided() == 0) return;
    stops.resize(length);
    trial.stops = std::move(stops);
    trial.samples_factor = samples_factor;
    trial.how = how;
    best = std::move(trial);
  };
  const std::vector<Stop> chosen = design.greedy(possible, kMost);
  const std::vector<Stop> shuffled = at_random(possible, kMost);
  std::vector<Stop> to_and_fro;
  if (chosen.size() >= 2)
    for (std::size_t k = 0; k < kMost; ++k) to_and_fro.push_back(chosen[k % 2]);
  constexpr std::size_t kFew = 24;
  for (const std::size_t most_stops : kLengths) {
    const std::size_t length = std::min(most_stops, chosen.size());
    if (length == 0) break;
    std::vector<Stop> sorted(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(length));
    sort_for_travel(sorted);
    const auto rows = design.rows(sorted, 1);
    consider(sorted, length, 1, "at the positions where they differ most", rows);
    if (best.decided() == design.rivals() || length == chosen.size()) break;
  }
  best.most = most;
  if (best.decided() == design.rivals() && best.stops.size() <= kFew) return best;
  for (const auto& [stops, factor, how] :
       {std::tuple<const std::vector<Stop>&, double, const char*>{shuffled, 1, "in random order"},
        {to_and_fro, 1, "to and fro between two positions"},
        {shuffled, 4, "in random order, with four times the dwell"}}) {
    if (stops.empty()) continue;
    const auto rows = design.rows(stops, factor);
    for (const std::size_t length : kLengths)
      if (length <= stops.size()) consider(stops, length, factor, how, rows);
  }
  best.most = most;
  return best;
}

}  // namespace plumbline
