// A model together with the noise that its residual supports.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// The model with noise of its own.
struct Stage {
  Observations observed;                     ///< freed of rounding as this model sees it
  PerAxis<Eigen::VectorXd> own_V2;           ///< variance that each mean has for itself
  PerAxis<bool> coarse{};                    ///< rounding matters
  PerAxis<std::optional<double>> beyond_V2;  ///< RoundingFree's
  /// Further variance, in `noise` too, of means near a step of the response, where slow noise
  /// decides on which side they are, and of those that effects leave open (Effect::ways_at_ties).
  /// Empty where it does not matter.
  PerAxis<Eigen::VectorXd> crossing_V2;
  EnlargedFit fit;
  PerAxis<PooledNoise> noise;
  PoseWhitening whitening;
};

/// What is known before the noise of a model is estimated.
struct Before {
  PerAxis<const PooledNoise*> known{};               ///< pooled already; null where it has not been
  const PoseWhitening* whitening = nullptr;          ///< by the noise that is known, if it is there
  const PerAxis<PooledNoise>* start = nullptr;       ///< powers to start from
  const PerAxis<Eigen::VectorXd>* powers = nullptr;  ///< given: nothing is estimated
  /// Means of coarse axes freed of rounding by this stage are used as they are: likelihoods can be
  /// compared for the same readings only.
  const Stage* freed = nullptr;
};
PerAxis<const PooledNoise*> all_of(const PerAxis<PooledNoise>& noise);

/// The noise under given parameters; `fit` and what whitens the means stay empty. `beside`: further
/// functions of the visits, n × any number, that the noise is estimated beside.
Stage settle_noise(const SearchInput& input, const EnlargedParameters& parameters,
                   const Before& before, const Eigen::MatrixXd& beside = {});

/// Whitens the means by the noise of the stage, which was settled after what is `before`.
void set_whitening(Stage& stage, const Before& before);

/// The same with the model fitted. Noise and parameters depend on each other only weakly: one round
/// after the parameters are known settles both.
Stage settle(const SearchInput& input, const EnlargedParameters& parameters, const Before& before);

/// −2 ln L of the readings of one axis under given parameters, but for a constant: its noise
/// estimated beside them, all else as in `stage`.
double deviance_of_axis(const SearchInput& input, const EnlargedParameters& parameters,
                        std::size_t axis, const Stage& stage);

/// The covariance of the parameters of `found`, the powers of its noise being estimates, too:
/// with_allowance() of all axes. `jacobian`: prediction_jacobian() there.
Eigen::MatrixXd with_allowance_for_noise(const SearchInput& input, const SearchResult& found,
                                         const Eigen::MatrixXd& jacobian);

/// Whether the height of the spindle is slow: one ring is visited after the other.
bool goes_ring_by_ring(const VisitLog& log);

/// What changes slowly and could pass for slow noise: the time to the second order, powers of the
/// height of the spindle where the order of the poses makes that slow, and what was
/// recorded; n × any number, each centred and of unit length.
Eigen::MatrixXd slow_functions(const VisitLog& log);

/// The same, and cosines of the time up to 16 half waves in the run (fewer where the visits are
/// few): whatever happened once and took a while is in their span.
Eigen::MatrixXd any_course_of_time(const VisitLog& log);

}  // namespace plumbline
