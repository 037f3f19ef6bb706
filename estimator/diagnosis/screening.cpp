#include "estimator/diagnosis/screening.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "estimator/noise/chi_squared.h"
#include "estimator/parallel_for.h"

namespace plumbline {

double log_chi_squared_tail(double x, double dof) {
  if (!(x > 0)) return 0;
  if (x < 200 || x < 10 * dof) return std::log(std::max(chi_squared_tail(x, dof), 1e-300));
  // Leading terms of the incomplete gamma function for large x.
  const double half = 0.5 * dof, y = 0.5 * x;
  return (half - 1) * std::log(y) - y - log_gamma(half) + std::log1p((half - 1) / y);
}

double sigmas_of(double log_p) {
  // The tail lies below exp(−z²/2).
  double low = 0, high = std::sqrt(std::max(0.0, -2 * log_p));
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (log_chi_squared_tail(middle * middle, 1) > log_p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double effective_looks(const CandidateGains& gains_of, std::size_t candidates, Eigen::Index rows,
                       std::uint64_t seed, int replicates) {
  Eigen::MatrixXd noise(rows, replicates);
  parallel_for(static_cast<std::size_t>(replicates), [&](std::size_t replicate) {
    std::mt19937_64 generator(seed + replicate);
    std::normal_distribution<double> normal;
    for (double& value : noise.col(static_cast<Eigen::Index>(replicate))) value = normal(generator);
  });
  const Eigen::MatrixXd gains = gains_of.of(gains_of.project(noise));
  // Among candidates of equal freedom the largest gain is the least probable.
  std::map<int, Eigen::VectorXd> largest;  // one per replicate
  for (std::size_t c = 0; c < candidates; ++c) {
    const auto gain = gains.col(static_cast<Eigen::Index>(c));
    Eigen::VectorXd& most = largest.try_emplace(gains_of.dof(c), gain).first->second;
    most = most.cwiseMax(gain);
  }
  largest.erase(0);
  Eigen::VectorXd log_none(replicates);  // that no candidate does as well in such noise
  parallel_for(static_cast<std::size_t>(replicates), [&](std::size_t replicate) {
    const auto r = static_cast<Eigen::Index>(replicate);
    double best = 0;
    for (const auto& [dof, gain] : largest)
      best = std::min(best, log_chi_squared_tail(gain(r), dof));
    log_none(r) = std::log1p(-std::exp(std::min(best, -1e-12)));
  });
  return std::max(1.0, -static_cast<double>(replicates) / log_none.sum());
}

double p_of_search(double log_p_local, double looks) {
  // Smaller than any double holds is still not zero.
  return std::max(-std::expm1(-looks * std::exp(log_p_local)), 1e-300);
}

std::vector<Scored> screen(const CandidateList& list, const CandidateGains& gains_of,
                           const Eigen::VectorXd& gains) {
  std::vector<Scored> best(list.family_size.size(),
                           {0, 0, std::numeric_limits<double>::infinity()});
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    if (gains_of.dof(c) == 0) continue;
    const std::size_t family = list.candidates[c].family;
    const double log_p = log_chi_squared_tail(gains(static_cast<Eigen::Index>(c)), gains_of.dof(c));
    const double score = log_p + std::log(static_cast<double>(list.family_size[family])) +
                         list.candidates[c].handicap;
    if (score < best[family].score) best[family] = {c, log_p, score, gains_of.dof(c)};
  }
  std::erase_if(best, [](const Scored& s) { return !std::isfinite(s.score); });
  std::stable_sort(best.begin(), best.end(),
                   [](const Scored& a, const Scored& b) { return a.score < b.score; });
  return best;
}

}  // namespace plumbline
