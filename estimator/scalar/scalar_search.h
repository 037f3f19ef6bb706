// Which effects of the catalogue does the residual |a| − g show? As diagnosis/search.h, for the one
// residual that a set without angles has.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/candidates.h"
#include "estimator/error_figures.h"
#include "estimator/scalar/scalar_fit.h"
#include "estimator/scalar/scalar_noise.h"

namespace plumbline {

struct ScalarSearchInput {
  const std::vector<RestMean>& rests;
  const InnerVariance& inner;
  const std::vector<SampleWindow>& windows;
};

/// One effect that joined the model.
struct ScalarFinding {
  Candidate candidate;
  double p_value = 1;       ///< of the whole search
  double sigmas = 0;        ///< the gain of fit when it joined, as that of one Gaussian quantity
  double heldout_gain = 0;  ///< share of the excess power on rests left out that it removes
  std::vector<std::string> alternatives;
};

struct ScalarSearchResult {
  ScalarFit fit;
  ScalarNoise noise;                    ///< under the final model
  std::vector<ScalarFinding> findings;  ///< in the order of fit.parameters.effects
  double p_best_rest = 1;               ///< of the best candidate that was not taken
  std::string best_rest;                ///< its id and axis
  std::size_t tried = 0;                ///< hypotheses
};

/// Effects that |a| can show: of the sensor, of recorded columns, and smooth terms without a name.
CandidateList scalar_candidates(const VisitLog& log);

/// Forward selection with joint re-estimation under the noise that broad structure leaves,
/// p-values of the largest statistic over the whole search (simulated noise, seeded), then a check
/// on left-out blocks of time and of attitude. Deterministic.
ScalarSearchResult search_scalar(ScalarData& data, const ScalarSearchInput& input,
                                 const ScalarFit& start, const CandidateList& list,
                                 std::uint64_t seed);

/// As detection_limits(), for the one residual of a set without angles: what its rests would have
/// shown at 5 standard uncertainties beside the final model, with the final noise.
std::vector<DetectionLimit> scalar_detection_limits(const ScalarData& data,
                                                    const CandidateList& list, const ScalarFit& fit,
                                                    const Eigen::MatrixXd& covariance);

/// Ten stretches of time, and the eight octants of attitude.
Blocks scalar_time_blocks(std::size_t rests);
Blocks scalar_attitude_blocks(const Eigen::MatrixXd& direction);
/// Residuals of the rests in each block against the fit to all others, to first order; NaN where
/// the others do not determine the model.
Eigen::VectorXd scalar_heldout_mps2(const ScalarFit& fit, const Eigen::MatrixXd& covariance,
                                    const Blocks& blocks);
/// Unit vectors of the specific force at the estimate, n × 3.
Eigen::MatrixXd scalar_directions(const ScalarData& data, const ScalarParameters& parameters);

}  // namespace plumbline
