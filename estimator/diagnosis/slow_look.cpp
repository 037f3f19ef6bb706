#include "estimator/diagnosis/slow_look.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "estimator/diagnosis/screening.h"
#include "estimator/linear_algebra.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

bool is_within(Eigen::VectorXd change, const Eigen::MatrixXd& basis) {
  constexpr double kMost = 0.7;  // of the sum of squares
  change.array() -= change.mean();
  return (basis.transpose() * change).squaredNorm() > kMost * change.squaredNorm();
}
/// Whether most of what a candidate does lies in the span of the slow functions. `responses_V`:
/// before they are whitened.
bool is_within(const CandidateResponses& responses_V, std::size_t candidate,
               const Eigen::MatrixXd& basis) {
  const auto& [group, first, count] = responses_V.place[candidate];
  return is_within(responses_V.groups[group].means.middleCols(first, count).rowwise().sum(), basis);
}

/// The open candidates of sensors that are slow, of the axes looked at. What shows within the dwell
/// does not hide in slow noise.
struct SlowCandidates {
  CandidateList list;
  std::vector<std::size_t> index;  ///< of each in the list that they are from
  CandidateResponses responses_V;
};
SlowCandidates slow_candidates(const SearchInput& input, const CandidateList& list,
                               const EnlargedParameters& model, const PerAxis<bool>& looked_at,
                               const SlowLook& look) {
  CandidateList open;
  open.family_size = list.family_size;
  std::vector<std::size_t> index;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    if (candidate.effect->subject() == Subject::head || candidate.effect->within_dwell() ||
        !looked_at[candidate.axis] || !look.is_open(candidate))
      continue;
    open.candidates.push_back(candidate);
    index.push_back(c);
  }
  const CandidateResponses responses_V = candidate_responses_V(input.log, open, model);
  const Eigen::MatrixXd basis = orthonormal_basis(look.beside);
  SlowCandidates slow;
  slow.list.family_size = list.family_size;
  std::vector<char> is_slow(index.size());
  parallel_for(index.size(), [&](std::size_t c) { is_slow[c] = is_within(responses_V, c, basis); });
  std::vector<std::size_t> within;
  for (std::size_t c = 0; c < index.size(); ++c) {
    if (!is_slow[c]) continue;
    slow.list.candidates.push_back(open.candidates[c]);
    slow.index.push_back(index[c]);
    within.push_back(c);
  }
  slow.responses_V = some_of(responses_V, within);
  return slow;
}

/// The model's noise beside what is slow. The readings of a coarse axis are freed of rounding once
/// more when its noise is known; the likelihood is that of those.
Stage settle_beside(const SearchInput& input, const EnlargedParameters& model, const Stage& stage,
                    const Eigen::MatrixXd& slow) {
  Stage rich = settle_noise(input, model, {.start = &stage.noise}, slow);
  if (rich.coarse == PerAxis<bool>{}) return rich;
  Before before{.known = all_of(rich.noise), .start = &rich.noise, .freed = &rich};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (rich.coarse[axis]) before.known[axis] = nullptr;
  rich.noise = settle_noise(input, model, before, slow).noise;
  return rich;
}

/// Best of each family by what it gains in −2 ln L to first order, each with the noise that suits
/// it: between that beside the model, which has to take up whatever is slow, and that beside all
/// that is slow, which has lost what was noise.
std::vector<Scored> screen_with_own_noise(const SearchInput& input, const SlowCandidates& slow,
                                          const EnlargedParameters& model,
                                          const PerAxis<PooledNoise>& plain, const Stage& rich) {
  constexpr std::array kTowardsRich = {0.0, 0.8, 0.96, 1.0};
  CandidateResponses responses;
  EnlargedFit fit;
  std::optional<CandidateGains> gains_of;
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(std::ssize(slow.index));
  for (const double share : kTowardsRich) {
    PerAxis<Eigen::VectorXd> powers;
    for (std::size_t i = 0; i < kAxisCount; ++i)
      powers[i] = plain[i].power + share * (rich.noise[i].power - plain[i].power);
    const Before before{.powers = &powers, .freed = &rich};
    Stage stage = settle_noise(input, model, before);
    set_whitening(stage, before);
    fit = fit_enlarged(input.log, stage.observed, stage.whitening, model);
    responses = whitened(slow.responses_V, input.log, stage.whitening);
    gains_of.emplace(responses, fit);
    const Eigen::VectorXd& with_these = gains_of->of_residual();
    for (Eigen::Index c = 0; c < gains.size(); ++c) {
      const std::size_t axis = slow.list.candidates[static_cast<std::size_t>(c)].axis;
      gains(c) = std::max(gains(c), with_these(c) + plain[axis].likelihood_deviance -
                                        stage.noise[axis].likelihood_deviance);
    }
  }
  return screen(slow.list, *gains_of, gains);
}

/// Of ranked candidates the likeliest, and the likeliest of what acts otherwise: shapes of one
/// driver take many of the first places, though few look the same once each has its own noise.
std::vector<Scored> likeliest_of_each_kind(const CandidateList& list,
                                           const std::vector<Scored>& ranked) {
  constexpr std::size_t kLikeliest = 6, kMost = 10;
  std::vector<Scored> worth;
  for (const Scored& s : ranked) {
    if (worth.size() == kMost) break;
    const auto acts_like_it =
        [&, id = list.candidates[s.candidate].effect->id()](const Scored& other) {
          return list.candidates[other.candidate].effect->id() == id;
        };
    if (worth.size() < kLikeliest || std::none_of(worth.begin(), worth.end(), acts_like_it))
      worth.push_back(s);
  }
  return worth;
}

}  // namespace

bool is_slow(const SearchInput& input, const EnlargedParameters& model, std::size_t effect,
             const Eigen::MatrixXd& beside) {
  const std::size_t axis = model.effects[effect].axis;
  const auto with_V = predict_means_V(input.log, model);
  const auto without_V = predict_means_V(input.log, without_effect(model, effect));
  return is_within(with_V[axis] - without_V[axis], orthonormal_basis(beside));
}

bool may_be_slow_noise(const SearchInput& input, const EnlargedParameters& model) {
  return model.effects.back().effect->subject() != Subject::head &&
         is_slow(input, model, model.effects.size() - 1, any_course_of_time(input.log));
}

double log_p_in_own_noise(const SearchInput& input, const EnlargedParameters& with,
                          const EnlargedParameters& without, std::size_t axis, int dof,
                          const Stage& stage) {
  const double gain =
      deviance_of_axis(input, without, axis, stage) - deviance_of_axis(input, with, axis, stage);
  return log_chi_squared_tail(std::max(0.0, gain), dof);
}

bool has_slow_noise(const SearchInput& input, const Stage& stage, std::size_t axis) {
  constexpr double kOfFast = 0.3;  // variances
  const Eigen::VectorXd& power = stage.noise[axis].power;
  double fast_V2 = stage.own_V2[axis].mean(), slow_V2 = 0;
  for (Eigen::Index i = 0; i < power.size(); ++i)
    (i < NoiseProcesses::kFirstSlow ? fast_V2 : slow_V2) +=
        power(i) * input.processes.variance_over_run(i);
  return slow_V2 > kOfFast * fast_V2;
}

std::optional<SlowFinding> look_among_slow(const SearchInput& input, const CandidateList& list,
                                           const Stage& stage, bool noise_is_own,
                                           const SlowLook& look) {
  constexpr double kHopeless = 0.9;  // to first order: its own noise and shapes gain it more
  const EnlargedParameters& model = stage.fit.parameters;
  const Stage rich = settle_beside(input, model, stage, look.beside);
  Before before{.whitening = &stage.whitening, .start = &stage.noise, .freed = &rich};
  // The noise that was handed in may have been estimated beside more than the model.
  for (std::size_t axis = 0; noise_is_own && axis < kAxisCount; ++axis)
    if (!rich.coarse[axis]) before.known[axis] = &stage.noise[axis];
  Stage beside_model = settle_noise(input, model, before);
  const PerAxis<PooledNoise>& plain = beside_model.noise;
  PerAxis<bool> looked_at = look.axes;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const double gain = plain[i].likelihood_deviance - rich.noise[i].likelihood_deviance;
    const double p = chi_squared_tail(std::max(0.0, gain), static_cast<double>(look.beside.cols()));
    looked_at[i] = looked_at[i] && (look.worth_a_look >= 1 || p < look.worth_a_look);
  }
  if (looked_at == PerAxis<bool>{}) return {};
  const SlowCandidates slow = slow_candidates(input, list, model, looked_at, look);
  std::vector<Scored> ranked = screen_with_own_noise(input, slow, model, plain, rich);
  for (Scored& s : ranked) s.candidate = slow.index[s.candidate];
  // Half of the chance goes to the few with a name, half to the many without.
  const auto with_name = std::count_if(ranked.begin(), ranked.end(), [&](const Scored& scored) {
    return list.candidates[scored.candidate].has_name();
  });
  const auto named = static_cast<std::size_t>(with_name);
  const std::size_t unnamed = ranked.size() - named;
  const auto p_of_look = [&](double log_p, std::size_t candidate) {
    const Candidate& c = list.candidates[candidate];
    if (look.is_on_another_axis(c)) return p_of_search(log_p, looks_on_axes(list, c));
    const std::size_t like_it = c.has_name() ? named : unnamed;
    return p_of_search(log_p, static_cast<double>(2 * like_it * list.family_size[c.family]));
  };
  std::erase_if(ranked,
                [&](const Scored& s) { return p_of_look(s.log_p, s.candidate) > kHopeless; });
  ranked = likeliest_of_each_kind(list, ranked);
  if (ranked.empty()) return {};
  set_whitening(beside_model, before);
  std::vector<Stage> stages(ranked.size());
  parallel_for(stages.size(), [&](std::size_t k) {
    const Candidate& candidate = list.candidates[ranked[k].candidate];
    Before compared{.known = all_of(plain),
                    .whitening = &beside_model.whitening,
                    .start = &rich.noise,
                    .freed = &rich};
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
    const double log_p = log_chi_squared_tail(gain, ranked[k].dof);
    // Few candidates are slow, so few looks were taken; and the noise is no longer at fault.
    const double p_value = p_of_look(log_p, ranked[k].candidate);
    const bool significant = p_value <= look.false_alarm[candidate.axis];
    const std::pair score{!significant, log_p + (ranked[k].score - ranked[k].log_p)};
    if (score >= best_score) continue;
    best_score = score;
    best = {ranked[k].candidate, std::move(with.fit.parameters), p_value, significant};
  }
  return best;
}

}  // namespace plumbline
