// A model together with the noise that its residual supports.
#pragma once

#include <Eigen/Core>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// The model with noise of its own.
struct Stage {
  Observations observed;            ///< freed of rounding as this model sees it
  PerAxis<Eigen::VectorXd> own_V2;  ///< variance that each mean has for itself
  EnlargedFit fit;
  PerAxis<PooledNoise> noise;
  PoseWhitening whitening;
};

/// Noise of an axis that has been pooled already; null where it has not.
using KnownNoise = PerAxis<const PooledNoise*>;
KnownNoise all_of(const PerAxis<PooledNoise>& noise);

/// The noise under given parameters; `fit` stays empty. `before`: powers to start from, or null;
/// `beside`: further functions of the visits, n × any number, that the noise is estimated beside.
Stage settle_noise(const SearchInput& input, const EnlargedParameters& parameters,
                   const KnownNoise& known, const PerAxis<PooledNoise>* before,
                   const Eigen::MatrixXd& beside = {});

/// The same with the model fitted. Noise and parameters depend on each other only weakly: one round
/// after the parameters are known settles both.
Stage settle(const SearchInput& input, const EnlargedParameters& parameters,
             const KnownNoise& known, const PerAxis<PooledNoise>* before);

/// What changes slowly and could pass for slow noise: the time to the second order, powers of the
/// height of the spindle where the order of the poses makes that slow, and what was
/// recorded; n × any number, each centred and of unit length.
Eigen::MatrixXd slow_functions(const VisitLog& log);

}  // namespace plumbline
