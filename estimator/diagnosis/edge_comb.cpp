#include "estimator/diagnosis/edge_comb.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

constexpr std::ptrdiff_t kFewestSteps = 12;
constexpr double kShortestPeriod = 8;  // distances between steps
constexpr int kMostPhases = 48;        // of a period
constexpr std::ptrdiff_t kFewToRefine = 12;

/// The steps nearest after the times phase + j·period.
class Comb {
 public:
  Comb(const std::vector<double>& at_s, double period_s, double phase_s) {
    const auto first = static_cast<long>(std::ceil((at_s.front() - phase_s) / period_s));
    const auto last = static_cast<long>(std::floor((at_s.back() - phase_s) / period_s));
    for (long j = first; j <= last; ++j) {
      const double t_s = phase_s + static_cast<double>(j) * period_s;
      steps.push_back(std::lower_bound(at_s.begin(), at_s.end() - 1, t_s) - at_s.begin());
    }
  }
  std::vector<Eigen::Index> steps;
};

/// Sets size and gain of a train that goes up at the steps of one comb and down at those of
/// another.
void fit(EdgeComb& train, const Comb& up, const Comb& down, const Eigen::VectorXd& products,
         const Eigen::MatrixXd& gram) {
  const double product = products(up.steps).sum() - products(down.steps).sum();
  double square = 0;
  for (const Comb* a : {&up, &down})
    for (const Comb* b : {&up, &down})
      for (const Eigen::Index k : a->steps)
        for (const Eigen::Index l : b->steps) square += (a == b ? 1 : -1) * gram(k, l);
  train.size = square > 0 ? product / square : 0;
  train.gain = train.size * product;
}

/// Moves the edges as long as that explains more, each time by less than the distance between
/// steps.
EdgeComb refined(EdgeComb train, const std::vector<double>& at_s, const Eigen::VectorXd& products,
                 const Eigen::MatrixXd& gram, double distance_s) {
  const double cycles = (at_s.back() - at_s.front()) / train.period_s;
  for (bool moved = true; moved;) {
    moved = false;
    for (const double share : {0.5, -0.5, 0.25, -0.25})
      for (const auto of : {&EdgeComb::period_s, &EdgeComb::first_up_s, &EdgeComb::width_s}) {
        EdgeComb other = train;
        other.*of += share * distance_s / (of == &EdgeComb::period_s ? cycles : 1);
        fit(other, {at_s, other.period_s, other.first_up_s},
            {at_s, other.period_s, other.first_up_s + other.width_s}, products, gram);
        if (other.gain <= train.gain) continue;
        train = other;
        moved = true;
      }
  }
  return train;
}

/// One for each width, the likeliest of those that were looked at.
std::vector<EdgeComb> trains_of_period(const std::vector<double>& at_s, double period_s,
                                       double distance_s, const Eigen::VectorXd& products,
                                       const Eigen::MatrixXd& gram) {
  const auto phases = std::min(kMostPhases, static_cast<int>(std::lround(period_s / distance_s)));
  std::vector<Comb> combs;
  std::vector<double> product;
  for (int phase = 0; phase < phases; ++phase) {
    combs.emplace_back(at_s, period_s, at_s.front() + period_s * phase / phases);
    product.push_back(products(combs.back().steps).sum());
  }
  const auto wrapped = [&](int phase) { return static_cast<std::size_t>(phase % phases); };
  std::vector<EdgeComb> trains;
  // Wider pulses are narrow ones of the other sign beside another zero. Of one width the train
  // with the largest product is the one to look at.
  for (int width = 1; width <= phases / 2; ++width) {
    int best_up = 0;
    double largest = 0;
    for (int up = 0; up < phases; ++up) {
      const double difference = std::abs(product[wrapped(up)] - product[wrapped(up + width)]);
      if (difference <= largest) continue;
      largest = difference;
      best_up = up;
    }
    EdgeComb train{.period_s = period_s,
                   .first_up_s = at_s.front() + period_s * best_up / phases,
                   .width_s = period_s * width / phases,
                   .looks = static_cast<double>(phases)};
    fit(train, combs[wrapped(best_up)], combs[wrapped(best_up + width)], products, gram);
    trains.push_back(train);
  }
  return trains;
}

}  // namespace

std::optional<EdgeComb> best_edge_comb(const std::vector<double>& at_s,
                                       const Eigen::VectorXd& products,
                                       const Eigen::MatrixXd& gram) {
  assert(std::ssize(at_s) == products.size() && products.size() == gram.rows());
  if (std::ssize(at_s) < kFewestSteps) return std::nullopt;
  const double span_s = at_s.back() - at_s.front();
  const double distance_s = span_s / static_cast<double>(at_s.size() - 1);
  const double shortest_s = kShortestPeriod * distance_s, ratio = 1 + 2 * distance_s / span_s;
  const auto periods =
      std::max(0L, std::lround(std::log(span_s / 1.5 / shortest_s) / std::log(ratio)));
  std::vector<std::vector<EdgeComb>> of_period(static_cast<std::size_t>(periods));
  parallel_for(of_period.size(), [&](std::size_t k) {
    const double period_s = shortest_s * std::pow(ratio, static_cast<double>(k));
    of_period[k] = trains_of_period(at_s, period_s, distance_s, products, gram);
  });
  std::vector<EdgeComb> trains;
  double looks = 0;
  for (const std::vector<EdgeComb>& some : of_period) {
    trains.insert(trains.end(), some.begin(), some.end());
    for (const EdgeComb& train : some) looks += train.looks;
  }
  const auto better = [](const EdgeComb& a, const EdgeComb& b) { return a.gain > b.gain; };
  const auto few = std::min<std::ptrdiff_t>(kFewToRefine, std::ssize(trains));
  if (few == 0) return std::nullopt;
  std::partial_sort(trains.begin(), trains.begin() + few, trains.end(), better);
  trains.resize(static_cast<std::size_t>(few));
  for (EdgeComb& train : trains) train = refined(train, at_s, products, gram, distance_s);
  EdgeComb best = *std::min_element(trains.begin(), trains.end(), better);
  best.looks = looks;
  return best;
}

std::optional<EdgeComb> regular_steps(const CandidateList& list,
                                      const CandidateResponses& responses, const EnlargedFit& fit,
                                      std::size_t axis) {
  std::vector<std::size_t> steps;  // neighbours among the candidates, in order of time
  std::vector<double> at_s;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    if (candidate.axis != axis || candidate.effect->id() != "sensor.bias_step") continue;
    steps.push_back(c);
    at_s.push_back(candidate.hypothesis.p[1]);
  }
  if (steps.empty()) return std::nullopt;
  const CandidateResponses::Place& place = responses.place[steps.front()];
  const CandidateResponses::Group& group = responses.groups[place.group];
  const Eigen::MatrixXd response = group.means.middleCols(place.first, std::ssize(steps));
  const auto rows = response.rows();
  const Eigen::MatrixXd taken =
      orthonormal_basis(fit.whitened_jacobian).middleRows(group.first_row, rows).transpose() *
      response;
  auto comb = best_edge_comb(
      at_s, response.transpose() * fit.whitened_residual.segment(group.first_row, rows),
      response.transpose() * response - taken.transpose() * taken);
  if (!comb) return std::nullopt;
  comb->first_step = steps.front();
  comb->size *= list.candidates[steps.front()].hypothesis.p[0];
  return comb;
}

}  // namespace plumbline
