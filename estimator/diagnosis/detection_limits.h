// How large each effect that was not found would have had to be.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "estimator/diagnosis/search.h"

namespace plumbline {

/// The hypotheses of a search beside its final model, to first order.
struct BesideModel {
  const CandidateList& list;
  std::function<bool(const Candidate&)> is_in_model;
  /// As CandidateGains::transform(): dof × columns, no rows for what the model absorbs.
  std::function<Eigen::MatrixXd(std::size_t candidate)> transform;
  /// How likely its gain is by itself in noise alone.
  std::function<double(std::size_t candidate)> log_p;
  /// The same transforms of further hypotheses.
  std::function<std::vector<Eigen::MatrixXd>(const CandidateList&)> transforms_of;
};

/// For every named effect that is not in the model, axis by axis: the amplitude that is 5 standard
/// uncertainties in the final model, with the final noise, estimated together with everything in
/// the model. An effect without amplitude (a dead zone, a clipping limit) is stated by the size at
/// which its response stands out as much. Beside it, by how many σ the effect's best hypothesis
/// stands out of what the final model leaves: the best of many, so that noise alone gives some.
/// First order in amplitudes.
std::vector<DetectionLimit> detection_limits(const BesideModel& beside);
std::vector<DetectionLimit> detection_limits(const SearchInput& input, const CandidateList& list,
                                             const SearchResult& result);

/// Adds to `limits` those of what the samples and codes show, not the pose means, where it is
/// neither there already nor among the `found` effects: a sine in every sample, 5 standard
/// uncertainties of its amplitude in white noise, √(2σ²/N); the declared steps that a coarser one
/// has to hold for its gaps among m codes to be no chance (coarser_lattice()); the bits, from
/// `best` to `worst`, that would be seen not to change (stuck_bits()). A bit has no size: `limit`
/// is the lowest. Without a declared converter the sine alone. model: for the sensitivities.
void add_limits_of_samples(const MeasurementSet& run, const VisitLog& log,
                           const TriadEstimate& model, const std::vector<FoundEffect>& found,
                           std::vector<DetectionLimit>& limits);

}  // namespace plumbline
