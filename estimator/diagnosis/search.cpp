#include "estimator/diagnosis/search.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "estimator/noise/chi_squared.h"
#include "estimator/parallel_for.h"

namespace plumbline {

double log_chi_squared_tail(double x, double dof) {
  if (!(x > 0)) return 0;
  if (x < 200) return std::log(std::max(chi_squared_tail(x, dof), 1e-300));
  // Leading terms of the incomplete gamma function for large x.
  const double half = 0.5 * dof, y = 0.5 * x;
  return (half - 1) * std::log(y) - y - std::lgamma(half) + std::log1p((half - 1) / y);
}

namespace {

// The model with noise of its own: powers that the residual under this model supports.
struct Stage {
  EnlargedFit fit;
  PerAxis<PooledNoise> noise;
  PoseWhitening whitening;
};

Eigen::MatrixXd independent_columns(const Eigen::MatrixXd& block) {
  // Columns of other axes are zero here; what one axis alone cannot tell apart stays in: a head
  // angle seen by this axis only weakly costs one degree of freedom at most.
  std::vector<Eigen::Index> kept;
  const Eigen::VectorXd norms = block.colwise().norm();
  Eigen::MatrixXd basis(block.rows(), 0);
  for (Eigen::Index j = 0; j < block.cols(); ++j) {
    if (!(norms(j) > 0)) continue;
    Eigen::VectorXd direction = block.col(j) / norms(j);
    direction -= basis * (basis.transpose() * direction);
    direction -= basis * (basis.transpose() * direction);
    if (direction.norm() < 1e-6) continue;
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.col(basis.cols() - 1) = direction.normalized();
  }
  return basis;
}

// Scatter of the contrasts about the model, from their median so that few odd dwells do not matter.
PerAxis<Eigen::VectorXd> dwell_scatter_V(const SearchInput& input,
                                         const EnlargedParameters& parameters) {
  const auto predicted = predict_dwells_V(input.log, parameters);
  PerAxis<Eigen::VectorXd> sd_V;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    sd_V[i].resize(kDwellContrasts);
    for (Eigen::Index d = 0; d < kDwellContrasts; ++d) {
      Eigen::VectorXd size = (input.observed.dwell_V[i].col(d) - predicted[i].col(d)).cwiseAbs();
      const auto middle = size.begin() + size.size() / 2;
      std::nth_element(size.begin(), middle, size.end());
      constexpr double kNormal = 1.4826;  // median of |x| to standard deviation
      // Contrasts that are all zero (single readings) carry no information.
      sd_V[i](d) = *middle > 0 ? kNormal * *middle : 1;
    }
  }
  return sd_V;
}

Stage stage_with(const SearchInput& input, const EnlargedParameters& start,
                 PerAxis<PooledNoise> noise) {
  Stage stage;
  stage.noise = std::move(noise);
  parallel_for(kAxisCount, [&](std::size_t i) {
    stage.whitening.lower[i] = Eigen::LLT<Eigen::MatrixXd>(stage.noise[i].covariance).matrixL();
  });
  stage.whitening.dwell_sd_V = dwell_scatter_V(input, start);
  stage.fit = fit_enlarged(input.log, input.observed, stage.whitening, start);
  return stage;
}

// Noise and parameters depend on each other only weakly: one round after the parameters are known
// settles both.
Stage settle(const SearchInput& input, const EnlargedParameters& parameters) {
  const auto predicted = predict_means_V(input.log, parameters);
  const Eigen::MatrixXd jacobian = prediction_jacobian(input.log, parameters);
  const Eigen::Index n = predicted[0].size();
  PerAxis<PooledNoise> noise;
  parallel_for(kAxisCount, [&](std::size_t i) {
    const Eigen::MatrixXd design =
        independent_columns(jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n));
    const Eigen::VectorXd residual = input.observed.mean_V[i] - predicted[i];
    noise[i] =
        best_pool(input.noise[i], input.windows, residual, design, input.extra_variance_V2[i])
            .pooled();
  });
  return stage_with(input, parameters, std::move(noise));
}

// How many independent looks the search amounts to: the best p-value of a search over pure noise
// is that of the best of so many.
double effective_looks(const CandidateGains& gains_of, std::size_t candidates, Eigen::Index rows,
                       const SearchOptions& options) {
  std::mt19937_64 generator(options.seed);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd noise(rows, options.replicates);
  for (double& value : noise.reshaped()) value = normal(generator);
  const Eigen::MatrixXd gains = gains_of.of(gains_of.project(noise));
  double sum = 0;
  for (Eigen::Index r = 0; r < gains.cols(); ++r) {
    double best = 0;
    for (std::size_t c = 0; c < candidates; ++c) {
      if (gains_of.dof(c) == 0) continue;
      best = std::min(
          best, log_chi_squared_tail(gains(static_cast<Eigen::Index>(c), r), gains_of.dof(c)));
    }
    sum += std::log1p(-std::exp(std::min(best, -1e-12)));
  }
  return std::max(1.0, -static_cast<double>(options.replicates) / sum);
}

double p_of_search(double log_p_local, double looks) {
  // Smaller than any double holds is still not zero.
  return std::max(-std::expm1(-looks * std::exp(log_p_local)), 1e-300);
}

struct Scored {
  std::size_t candidate = 0;
  double log_p = 0;  ///< of its own test
  double score = 0;  ///< log_p plus the price of a large family and of having no name
};

// Best hypothesis of each family by the first-order gain, best family first.
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
    if (score < best[family].score) best[family] = {c, log_p, score};
  }
  std::erase_if(best, [](const Scored& s) { return !std::isfinite(s.score); });
  std::sort(best.begin(), best.end(),
            [](const Scored& a, const Scored& b) { return a.score < b.score; });
  return best;
}

EnlargedParameters with_effect(EnlargedParameters model, const ActiveEffect& active) {
  model.effects.push_back(active);
  return model;
}

}  // namespace

SearchResult search_effects(const SearchInput& input, const CandidateList& list,
                            const SearchOptions& options) {
  constexpr std::size_t kRefined = 10;  // families that are refitted in full at each step
  SearchResult result;
  Stage stage = input.pooled != nullptr ? stage_with(input, input.start, *input.pooled)
                                        : settle(input, input.start);
  std::vector<Candidate> chosen;
  std::vector<double> p_values;
  double looks = 1;

  while (true) {
    const CandidateResponses responses =
        candidate_responses(input.log, list, stage.whitening, stage.fit.parameters);
    const CandidateGains gains_of(responses, stage.fit);
    const Eigen::VectorXd gains = gains_of.of(stage.fit.whitened_residual).col(0);
    const std::vector<Scored> ranked = screen(list, gains_of, gains);
    if (ranked.empty()) break;
    // The number of looks hardly changes while the model grows.
    if (chosen.empty())
      looks = effective_looks(gains_of, list.candidates.size(), stage.fit.whitened_residual.size(),
                              options);
    const double best_log_p =
        std::min_element(ranked.begin(), ranked.end(), [](const Scored& a, const Scored& b) {
          return a.log_p < b.log_p;
        })->log_p;
    result.p_best_rest = p_of_search(best_log_p, looks);
    if (result.p_best_rest > options.false_alarm || chosen.size() == options.max_effects) break;

    // First order ranks; the full response decides.
    const Scored* winner = nullptr;
    EnlargedFit winner_fit;
    double winner_score = std::numeric_limits<double>::infinity(), winner_log_p = 0;
    for (std::size_t k = 0; k < std::min(kRefined, ranked.size()); ++k) {
      const Scored& s = ranked[k];
      EnlargedFit fit =
          fit_enlarged(input.log, input.observed, stage.whitening,
                       with_effect(stage.fit.parameters, list.candidates[s.candidate].active()));
      if (!fit.determined) continue;
      const double dof = gains_of.dof(s.candidate);
      const double log_p = log_chi_squared_tail(stage.fit.chi2 - fit.chi2, dof);
      const double score = log_p + (s.score - s.log_p);
      if (score < winner_score) {
        winner = &s;
        winner_fit = std::move(fit);
        winner_score = score;
        winner_log_p = log_p;
      }
    }
    if (winner == nullptr || p_of_search(winner_log_p, looks) > options.false_alarm) break;
    chosen.push_back(list.candidates[winner->candidate]);
    p_values.push_back(p_of_search(winner_log_p, looks));
    stage = settle(input, winner_fit.parameters);

    // Backward: what the newcomer has made superfluous goes.
    for (std::size_t k = chosen.size(); k-- > 0 && chosen.size() > 1;) {
      EnlargedParameters without = stage.fit.parameters;
      without.effects.erase(without.effects.begin() + static_cast<std::ptrdiff_t>(k));
      const EnlargedFit fit = fit_enlarged(input.log, input.observed, stage.whitening, without);
      const auto free =
          static_cast<double>(stage.fit.parameters.free_count() - without.free_count());
      const double log_p = log_chi_squared_tail(fit.chi2 - stage.fit.chi2, std::max(1.0, free));
      if (p_of_search(log_p, looks) < options.false_alarm) continue;
      chosen.erase(chosen.begin() + static_cast<std::ptrdiff_t>(k));
      p_values.erase(p_values.begin() + static_cast<std::ptrdiff_t>(k));
      stage = settle(input, fit.parameters);
    }
  }

  for (std::size_t k = 0; k < chosen.size(); ++k) {
    EnlargedParameters without = stage.fit.parameters;
    without.effects.erase(without.effects.begin() + static_cast<std::ptrdiff_t>(k));
    const EnlargedFit fit = fit_enlarged(input.log, input.observed, stage.whitening, without);
    result.evidence.push_back({chosen[k], fit.chi2 - stage.fit.chi2, p_values[k]});
  }
  result.fit = std::move(stage.fit);
  result.noise = std::move(stage.noise);
  result.whitening = std::move(stage.whitening);
  return result;
}

}  // namespace plumbline
