// Which effects does the residual show? Forward selection with joint re-estimation, backward
// elimination, and a p-value for the search as a whole.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/diagnosis/candidate_responses.h"
#include "estimator/noise/noise_model.h"
#include "estimator/noise/reml.h"

namespace plumbline {

struct SearchOptions {
  std::uint64_t seed = 1;
  /// Nominal chance that noise alone makes the search claim an effect. Far below the 1 % wanted,
  /// because the noise itself is only estimated: slow drifts come out too significant.
  double false_alarm = 1e-4;
  /// The same for an effect that another axis has already shown.
  double false_alarm_on_another_axis = 1e-3;
  /// The same for a slow effect that is compared with the noise estimated anew under each
  /// hypothesis; on an axis whose converter is coarse, where what is left of rounding follows the
  /// positions and is slow when they are, less.
  double false_alarm_of_slow = 1e-3;
  double false_alarm_of_slow_when_coarse = 1e-5;
  /// Of a train of pulses where readings hang on the edges of codes: it gathers whatever is odd at
  /// some visits, which is not Gaussian there.
  double false_alarm_of_train_at_edges = 1e-6;
  int replicates = 150;  ///< of simulated noise, for the look-elsewhere correction
  std::size_t max_effects = 6;
};

/// The data of a search; n visits.
struct SearchInput {
  const VisitLog& log;
  const Observations& observed;  ///< as measured
  const PerAxis<NoiseModel>& noise;
  const NoiseProcesses& processes;           ///< at the n visits
  const PerAxis<Eigen::VectorXd>& known_V2;  ///< n known variances, V²
  EnlargedParameters start;                  ///< the 12 parameters, no effects
  /// Noise beside the 12 parameters when it is known already; null: the search finds it.
  const PerAxis<PooledNoise>* pooled = nullptr;
};

inline constexpr double kProven = 1e-300;  ///< p-value of what the codes prove without a search

/// One effect in the model, and what speaks for it.
struct Evidence {
  Candidate candidate;
  double p_value = 1;  ///< of the whole search
  double sigmas = 0;   ///< FoundEffect::sigmas, in the final model of the search
};

struct SearchResult {
  EnlargedFit fit;  ///< 12 parameters and the effects, in the order of `evidence`
  std::vector<Evidence> evidence;
  Observations observed;                     ///< freed of rounding as the final model sees it
  PerAxis<Eigen::VectorXd> own_V2;           ///< variance that each mean has for itself
  PerAxis<bool> coarse{};                    ///< rounding matters
  PerAxis<std::optional<double>> beyond_V2;  ///< RoundingFree's
  PerAxis<PooledNoise> noise;                ///< re-estimated under the final model
  PoseWhitening whitening;
  /// Of the candidates beside the final model: large, shared by copies.
  std::shared_ptr<const CandidateResponses> responses;
  double p_best_rest = 1;  ///< p-value of the best candidate that was not taken

  /// Takes an effect out of the model and its evidence; the rest is to be fitted anew.
  void remove(std::size_t effect) {
    fit.parameters = without_effect(std::move(fit.parameters), effect);
    evidence.erase(evidence.begin() + static_cast<std::ptrdiff_t>(effect));
  }
};

/// Deterministic in input and options.
SearchResult search_effects(const SearchInput& input, const CandidateList& list,
                            const SearchOptions& options);

}  // namespace plumbline
