// Slow effects, which hide in slow noise that was estimated without them.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>

#include "estimator/diagnosis/noise_stage.h"
#include "estimator/diagnosis/search.h"

namespace plumbline {

/// Where a look among the slow candidates goes.
struct SlowLook {
  const Eigen::MatrixXd& beside;  ///< what is slow, n × any number of functions of the visits
  PerAxis<bool> axes;
  /// An axis is looked at when all of `beside` together has a smaller p-value; 1: always.
  double worth_a_look;
  /// p-value of the look below which a candidate counts as significant, per axis.
  PerAxis<double> false_alarm;
  std::function<bool(const Candidate&)> is_open;  ///< whether a candidate may join the model
  std::function<bool(const Candidate&)> is_on_another_axis;  ///< SearchModel's
};

/// The candidate that a look found, and what speaks for it.
struct SlowFinding {
  std::size_t candidate = 0;
  EnlargedParameters model;  ///< with it, fitted
  double p_value = 1;        ///< of the look as a whole
  bool significant = false;
};

/// The noise is estimated once more, beside all that is slow, and the candidates are compared by
/// the likelihood of each with its own noise; what is not significant comes behind what is, however
/// well known its name. `noise_is_own`: the noise of `stage` was estimated
/// beside its model and nothing else. Empty when nothing was worth a look or is determined.
std::optional<SlowFinding> look_among_slow(const SearchInput& input, const CandidateList& list,
                                           const Stage& stage, bool noise_is_own,
                                           const SlowLook& look);

/// Whether most of what one of the model's effects on a sensor does could be slow noise: lies in
/// the span of `beside`.
bool is_slow(const SearchInput& input, const EnlargedParameters& model, std::size_t effect,
             const Eigen::MatrixXd& beside);

/// The same of the last one, whatever it acts on, and of any course of time.
bool may_be_slow_noise(const SearchInput& input, const EnlargedParameters& model);

/// ln of the p-value of one more effect, of `dof` free parameters, by the likelihood of the
/// readings of an axis with it and without, each with the noise that suits it; all else as in
/// `stage`.
double log_p_in_own_noise(const SearchInput& input, const EnlargedParameters& with,
                          const EnlargedParameters& without, std::size_t axis, int dof,
                          const Stage& stage);

/// Whether there is slow noise in which an effect could hide.
bool has_slow_noise(const SearchInput& input, const Stage& stage, std::size_t axis);

}  // namespace plumbline
