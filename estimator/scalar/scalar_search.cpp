#include "estimator/scalar/scalar_search.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/fit/least_squares.h"
#include "estimator/linear_algebra.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/scalar/scalar_alternatives.h"

namespace plumbline {
namespace {

constexpr double kFalseAlarm = 1e-3;
constexpr std::size_t kMostEffects = 6;
constexpr int kReplicates = 400;

/// What the noise must not swallow: everything smooth in attitude up to the fourth order of a
/// sensor, and drift.
Eigen::MatrixXd broad_structure(const Eigen::MatrixXd& direction, const ScalarFit& fit) {
  const Eigen::Index n = direction.rows();
  constexpr Eigen::Index kCubics = 10, kDrifts = 3;
  if (n < kScalarCount + 2 * (kCubics + kDrifts)) return fit.jacobian;
  Eigen::MatrixXd all(n, fit.jacobian.cols() + kCubics + kDrifts);
  all.leftCols(fit.jacobian.cols()) = fit.jacobian;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::RowVector3d u = direction.row(k);
    Eigen::Index at = fit.jacobian.cols();
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
        for (int l = j; l < 3; ++l) all(k, at++) = u(i) * u(j) * u(l);
    for (int i = 0; i < 3; ++i)
      all(k, at++) = u(i) * (static_cast<double>(k) / static_cast<double>(n) - 0.5);
  }
  return all;
}

ScalarNoise noise_of(const ScalarData& data, const ScalarSearchInput& input, const ScalarFit& fit) {
  const Eigen::MatrixXd direction = scalar_directions(data, fit.parameters);
  return scalar_noise(input.inner.blocks, fit.residual_mps2,
                      orthonormal_basis(broad_structure(direction, fit)), direction, input.windows);
}

/// log P(F > f): by the distribution itself, and by its leading term where that underflows.
double log_f_tail(double gain, double dof, double rest, double rest_dof) {
  if (!(rest_dof > 0) || !(rest > 0)) return 0;
  const double f = gain / dof / (rest / rest_dof);
  const double tail = f_tail(f, dof, rest_dof);
  if (tail > 1e-280) return std::log(tail);
  return -0.5 * rest_dof * std::log1p(gain / rest);
}

/// The most telling candidate for each of some residuals.
struct Best {
  double log_p = 0;
  std::size_t candidate = 0;
};

Best best_of(const ScalarDirections& directions, const CandidateList& list,
             const Eigen::VectorXd& projected, double free_dof) {
  // Among candidates of equal freedom and handicap the largest gain is the most telling one, so the
  // distribution is evaluated once for each such group.
  struct Leader {
    int dof;
    double handicap;
    double gain;
    std::size_t candidate;
  };
  std::vector<Leader> leaders;
  const Eigen::VectorXd gains = directions.gains(projected);
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const int dof = directions.dof(c);
    if (dof == 0) continue;
    const double handicap = list.candidates[c].handicap;
    const double gain = gains(static_cast<Eigen::Index>(c));
    const auto leader = std::find_if(leaders.begin(), leaders.end(), [&](const Leader& l) {
      return l.dof == dof && l.handicap == handicap;
    });
    if (leader == leaders.end()) {
      leaders.push_back({dof, handicap, gain, c});
    } else if (gain > leader->gain) {
      leader->gain = gain;
      leader->candidate = c;
    }
  }
  Best best;
  const double total = projected.squaredNorm();
  for (const Leader& leader : leaders) {
    const double log_p =
        log_f_tail(leader.gain, leader.dof, total - leader.gain, free_dof - leader.dof) +
        leader.handicap;
    if (log_p < best.log_p) best = {log_p, leader.candidate};
  }
  return best;
}

/// Distribution of the best log p when there is noise alone: p = 1 − exp(−N·p_local).
double independent_tests(const ScalarDirections& directions, const CandidateList& list,
                         Eigen::Index n, double free_dof, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<double> smallest;
  for (int r = 0; r < kReplicates; ++r) {
    const Eigen::VectorXd noise =
        Eigen::VectorXd::NullaryExpr(n, [&](Eigen::Index) { return normal(random); });
    smallest.push_back(best_of(directions, list, directions.project(noise), free_dof).log_p);
  }
  // The tail is what matters: N from the 5 % quantile.
  constexpr double kTail = 0.05;
  const auto at = static_cast<std::ptrdiff_t>(kTail * kReplicates);
  std::nth_element(smallest.begin(), smallest.begin() + at, smallest.end());
  return -std::log1p(-kTail) / std::exp(smallest[static_cast<std::size_t>(at)]);
}

double power(const Eigen::VectorXd& errors) { return rms(errors) * rms(errors); }

/// Excess held-out power without and with the effect.
double heldout_gain(const ScalarFit& without, const ScalarFit& with,
                    const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& direction,
                    double expected_mps2) {
  double before = 0, after = 0;
  for (const Blocks& blocks : {scalar_time_blocks(static_cast<std::size_t>(direction.rows())),
                               scalar_attitude_blocks(direction)}) {
    before += power(scalar_heldout_mps2(without, covariance, blocks));
    after += power(scalar_heldout_mps2(with, covariance, blocks));
  }
  const double expected = 2 * expected_mps2 * expected_mps2;
  if (!std::isfinite(before) || !std::isfinite(after)) return -1;
  return (before - after) / std::max({before - expected, before - after, 1e-12 * before});
}

/// Removes effects that do not help on rests that were left out.
void drop_what_does_not_carry(ScalarData& data, const ScalarSearchInput& input,
                              ScalarSearchResult& result) {
  for (bool dropped = true; dropped && !result.findings.empty();) {
    dropped = false;
    const Eigen::MatrixXd direction = scalar_directions(data, result.fit.parameters);
    for (std::size_t k = 0; k < result.findings.size(); ++k) {
      ScalarParameters fewer = result.fit.parameters;
      fewer.effects.erase(fewer.effects.begin() + static_cast<std::ptrdiff_t>(k));
      ScalarFit without = fit_scalar(data, fewer, result.noise.covariance);
      const double gain = heldout_gain(without, result.fit, result.noise.covariance, direction,
                                       std::sqrt(input.inner.blocks.mean()));
      if (gain > 0) {
        result.findings[k].heldout_gain = gain;
        continue;
      }
      result.fit = std::move(without);
      result.findings.erase(result.findings.begin() + static_cast<std::ptrdiff_t>(k));
      dropped = true;
      break;
    }
  }
  set_attitudes(data, result.fit.parameters.nine);
}

std::string name_of(const Candidate& candidate) {
  return candidate.effect->id() + " (" + kAxisName[candidate.axis] + ")";
}

}  // namespace

CandidateList scalar_candidates(const VisitLog& log) {
  constexpr double kUnnamed = 7;  // log-probability, as in all_candidates()
  CandidateList list;
  for (const Effect* effect : effect_catalogue()) {
    if (effect->subject() == Subject::sensor && effect->id().rfind("sensor.", 0) == 0) {
      add_candidates(list, log, *effect);
    }
  }
  for (auto& effect : covariate_effects(log)) {
    list.owned.push_back(std::move(effect));
    add_candidates(list, log, *list.owned.back());
  }
  for (auto& term : smooth_terms(log, SmoothTermSelection::shown_by_these_visits)) {
    // There is no head; its angles here are only another way to write the attitude. What happens
    // within a rest does not show in its mean.
    if (term->form() == TermForm::sample || term->subject() == Subject::head ||
        term->driver() == "delta_deg" || term->driver() == "h_deg" ||
        term->driver().starts_with("code_")) {
      continue;
    }
    list.owned.push_back(std::move(term));
    add_candidates(list, log, *list.owned.back(), kUnnamed);
  }
  return list;
}

Eigen::MatrixXd scalar_directions(const ScalarData& data, const ScalarParameters& parameters) {
  const auto force = scalar_forces_mps2(data, parameters);
  Eigen::MatrixXd direction(std::ssize(force), 3);
  for (Eigen::Index k = 0; k < direction.rows(); ++k) {
    direction.row(k) = force[static_cast<std::size_t>(k)].normalized().transpose();
  }
  return direction;
}

Blocks scalar_time_blocks(std::size_t rests) {
  const std::size_t count = std::min<std::size_t>(10, rests);
  Blocks blocks(count);
  for (std::size_t k = 0; k < rests; ++k) {
    blocks[k * count / rests].push_back(static_cast<Eigen::Index>(k));
  }
  return blocks;
}

Blocks scalar_attitude_blocks(const Eigen::MatrixXd& direction) {
  Blocks blocks(8);
  for (Eigen::Index k = 0; k < direction.rows(); ++k) {
    std::size_t octant = 0;
    for (Eigen::Index i = 0; i < 3; ++i) octant = 2 * octant + (direction(k, i) > 0 ? 1 : 0);
    blocks[octant].push_back(k);
  }
  return blocks;
}

Eigen::VectorXd scalar_heldout_mps2(const ScalarFit& fit, const Eigen::MatrixXd& covariance,
                                    const Blocks& blocks) {
  const Eigen::Index n = fit.residual_mps2.size(), p = fit.jacobian.cols();
  Eigen::VectorXd heldout = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  for (const std::vector<Eigen::Index>& block : blocks) {
    if (block.empty()) continue;
    std::vector<Eigen::Index> rest;
    for (Eigen::Index k = 0; k < n; ++k) {
      if (!std::binary_search(block.begin(), block.end(), k)) rest.push_back(k);
    }
    if (std::ssize(rest) <= p) continue;
    const auto whitening = Whitening::of(covariance(rest, rest));
    const Eigen::MatrixXd J = whitening->apply(fit.jacobian(rest, Eigen::all));
    const LeastSquaresResult solved = solve_least_squares(
        J, whitening->apply(-fit.residual_mps2(rest)), {.rank_tolerance = 1e-4});
    if (solved.rank < p) continue;
    heldout(block) = fit.residual_mps2(block) + fit.jacobian(block, Eigen::all) * solved.x;
  }
  return heldout;
}

ScalarSearchResult search_scalar(ScalarData& data, const ScalarSearchInput& input,
                                 const ScalarFit& start, const CandidateList& list,
                                 std::uint64_t seed) {
  std::mt19937_64 random(seed);
  ScalarSearchResult result;
  result.tried = list.candidates.size();
  result.fit = start;
  result.noise = noise_of(data, input, result.fit);
  result.fit = fit_scalar(data, result.fit.parameters, result.noise.covariance);
  const Eigen::Index n = result.fit.residual_mps2.size();
  while (result.findings.size() <= kMostEffects) {
    const double free_dof = static_cast<double>(n - result.fit.jacobian.cols());
    if (free_dof < 3) break;
    const ScalarDirections directions(data, list, result.fit, result.noise.covariance);
    const Best best =
        best_of(directions, list, directions.project(result.fit.whitened_residual), free_dof);
    const double tests = independent_tests(directions, list, n, free_dof, random);
    const double p_value = -std::expm1(-tests * std::exp(best.log_p));
    const Candidate& candidate = list.candidates[best.candidate];
    if (p_value > kFalseAlarm || result.findings.size() == kMostEffects) {
      result.p_best_rest = p_value;
      result.best_rest = name_of(candidate);
      break;
    }
    ScalarParameters larger = result.fit.parameters;
    larger.effects.push_back(
        directions.started(candidate, result.fit.whitened_residual, best.candidate));
    result.fit = fit_scalar(data, larger, result.noise.covariance);
    result.noise = noise_of(data, input, result.fit);
    result.fit = fit_scalar(data, result.fit.parameters, result.noise.covariance);
    result.findings.push_back({candidate, p_value, sigmas_of(best.log_p), 0, {}});
  }
  drop_what_does_not_carry(data, input, result);
  for (std::size_t k = 0; k < result.findings.size(); ++k) {
    result.findings[k].alternatives =
        scalar_alternatives(data, list, result.fit, result.noise.covariance, k);
  }
  return result;
}

std::vector<DetectionLimit> scalar_detection_limits(const ScalarData& data,
                                                    const CandidateList& list, const ScalarFit& fit,
                                                    const Eigen::MatrixXd& covariance) {
  const ScalarDirections directions(data, list, fit, covariance);
  const Eigen::VectorXd projected = directions.project(fit.whitened_residual);
  const Eigen::VectorXd gain = directions.gains(projected);
  const double total = projected.squaredNorm();
  const auto free_dof = static_cast<double>(fit.residual_mps2.size() - fit.jacobian.cols());
  return detection_limits(
      {list,
       [&](const Candidate& candidate) {
         return std::any_of(fit.parameters.effects.begin(), fit.parameters.effects.end(),
                            [&](const ActiveEffect& active) {
                              return active.effect == candidate.effect &&
                                     active.axis == candidate.axis;
                            });
       },
       [&](std::size_t c) { return directions.transform(list.candidates[c], c); },
       [&](std::size_t c) {
         const double own = gain(static_cast<Eigen::Index>(c)), dof = directions.dof(c);
         return log_f_tail(own, dof, total - own, free_dof - dof);
       },
       [&](const CandidateList& closer) {
         const ScalarDirections beside(data, closer, fit, covariance);
         std::vector<Eigen::MatrixXd> transforms;
         transforms.reserve(closer.candidates.size());
         for (std::size_t c = 0; c < closer.candidates.size(); ++c)
           transforms.push_back(beside.transform(closer.candidates[c], c));
         return transforms;
       }});
}

}  // namespace plumbline
