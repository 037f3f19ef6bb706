#include "estimator/diagnosis/slow_look.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "estimator/diagnosis/screening.h"
#include "estimator/linear_algebra.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

/// Whether most of what a candidate does to its axis lies in the span of the slow functions.
bool is_within(const SearchInput& input, const EnlargedParameters& model,
               const Candidate& candidate, const Eigen::MatrixXd& basis) {
  constexpr double kMost = 0.7;  // of the sum of squares
  Eigen::VectorXd change =
      predict_means_V(input.log, with_effect(model, candidate.active()))[candidate.axis] -
      predict_means_V(input.log, model)[candidate.axis];
  change.array() -= change.mean();
  return (basis.transpose() * change).squaredNorm() > kMost * change.squaredNorm();
}

}  // namespace

bool has_slow_noise(const SearchInput& input, const Stage& stage, std::size_t axis) {
  constexpr double kOfFast = 0.3;  // variances
  const auto& unit = input.processes.unit;
  const Eigen::VectorXd& power = stage.noise[axis].power;
  double fast_V2 = stage.own_V2[axis].mean(), slow_V2 = 0;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const double over_the_run = unit[i].diagonal().mean() - unit[i].mean();
    (i < kTermB ? fast_V2 : slow_V2) += power(static_cast<Eigen::Index>(i)) * over_the_run;
  }
  return slow_V2 > kOfFast * fast_V2;
}

std::optional<SlowFinding> look_among_slow(const SearchInput& input, const CandidateList& list,
                                           const Stage& stage, bool noise_is_own,
                                           const SlowLook& look) {
  constexpr std::size_t kRefined = 4;
  const EnlargedParameters& model = stage.fit.parameters;
  const Stage rich = settle_noise(input, model, {{}, &stage.noise, nullptr}, look.beside);
  Before before{{}, &stage.noise, &rich};
  // The noise that was handed in may have been estimated beside more than the model.
  for (std::size_t axis = 0; noise_is_own && axis < kAxisCount; ++axis)
    if (!rich.coarse[axis]) before.known[axis] = &stage.noise[axis];
  const PerAxis<PooledNoise> plain = settle_noise(input, model, before).noise;
  PerAxis<bool> looked_at = look.axes;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const double gain = plain[i].likelihood_deviance - rich.noise[i].likelihood_deviance;
    const double p = chi_squared_tail(std::max(0.0, gain), static_cast<double>(look.beside.cols()));
    looked_at[i] = looked_at[i] && (look.worth_a_look >= 1 || p < look.worth_a_look);
  }
  if (looked_at == PerAxis<bool>{}) return {};
  const EnlargedFit rich_fit = fit_enlarged(input.log, rich.observed, rich.whitening, model);
  const CandidateResponses beside_slow =
      candidate_responses(input.log, list, rich.whitening, rich_fit.parameters);
  const CandidateGains gains(beside_slow, rich_fit);
  std::vector<Scored> ranked = screen(list, gains, gains.of(rich_fit.whitened_residual).col(0));
  const Eigen::MatrixXd slow = orthonormal_basis(look.beside);
  std::erase_if(ranked, [&](const Scored& s) {
    const Candidate& c = list.candidates[s.candidate];
    return c.effect->subject() == Subject::head || !looked_at[c.axis] || !look.is_open(c) ||
           !is_within(input, model, c, slow);
  });
  std::vector<Stage> stages(std::min(kRefined, ranked.size()));
  parallel_for(stages.size(), [&](std::size_t k) {
    const Candidate& candidate = list.candidates[ranked[k].candidate];
    Before compared{all_of(plain), &rich.noise, &rich};
    compared.known[candidate.axis] = nullptr;
    // So little is known of a slow effect that a time constant would run away before the amplitude
    // is known, and sometimes after.
    const ActiveEffect active = candidate.active();
    stages[k] = settle(input, with_effect(model, with_shapes_held(active)), compared);
    EnlargedParameters freed = stages[k].fit.parameters;
    if (!stages[k].fit.determined || freed.effects.back().free == active.free) return;
    freed.effects.back().free = active.free;
    Stage with = settle(input, freed, compared);
    if (with.fit.determined) stages[k] = std::move(with);
  });
  std::optional<SlowFinding> best;
  std::pair best_score{true, std::numeric_limits<double>::infinity()};
  for (std::size_t k = 0; k < stages.size(); ++k) {
    const Candidate& candidate = list.candidates[ranked[k].candidate];
    Stage& with = stages[k];
    if (!with.fit.determined) continue;
    const double gain =
        plain[candidate.axis].likelihood_deviance - with.noise[candidate.axis].likelihood_deviance;
    const double log_p = log_chi_squared_tail(gain, gains.dof(ranked[k].candidate));
    // Few candidates are slow, so few looks were taken; and the noise is no longer at fault.
    const double p_value =
        p_of_search(log_p, static_cast<double>(ranked.size() * list.family_size[candidate.family]));
    const std::pair score{p_value > look.false_alarm, log_p + (ranked[k].score - ranked[k].log_p)};
    if (score >= best_score) continue;
    best_score = score;
    best = {ranked[k].candidate, std::move(with.fit.parameters), p_value};
  }
  return best;
}

}  // namespace plumbline
