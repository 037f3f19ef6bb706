// Candidates as directions of the residual |a| − g, and which of them say the same.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/diagnosis/candidates.h"
#include "estimator/scalar/scalar_fit.h"

namespace plumbline {

/// What each candidate would add to a fitted model: whitened, free of what the model takes up,
/// orthonormal within a candidate. All directions are taken at the attitudes of the fit with the
/// residual itself taken off: otherwise a function of the readings that is nearly absorbed would
/// leave the residual as its own explanation.
class ScalarDirections {
 public:
  ScalarDirections(const ScalarData& data, const CandidateList& list, const ScalarFit& fit,
                   const Eigen::MatrixXd& covariance);

  int dof(std::size_t candidate) const { return dof_[candidate]; }
  /// By how much each candidate lowers the sum of squares of a projected, whitened residual.
  Eigen::VectorXd gains(const Eigen::VectorXd& projected) const;
  /// Removes what the model's own parameters take up.
  Eigen::VectorXd project(const Eigen::VectorXd& whitened) const;
  /// n × dof.
  Eigen::MatrixXd basis(std::size_t candidate) const;
  /// As CandidateGains::transform(): its columns, at the hypothesis, to the basis; dof × columns.
  Eigen::MatrixXd transform(const Candidate& candidate, std::size_t index) const;
  /// The candidate with amplitudes that fit this whitened residual to first order.
  ActiveEffect started(const Candidate& candidate, const Eigen::VectorXd& whitened_residual,
                       std::size_t index) const;

 private:
  Eigen::MatrixXd model_basis_;
  Eigen::MatrixXd basis_;    ///< n × Σ dof
  Eigen::MatrixXd columns_;  ///< n × amplitudes, projected, per unit of each amplitude
  std::vector<int> dof_;
  std::vector<Eigen::Index> first_;         ///< in basis_
  std::vector<Eigen::Index> first_column_;  ///< in columns_
  std::vector<std::vector<std::size_t>> amplitude_;
};

/// Explanations that these data cannot tell from effect `index` of the fit: ids, or two joined by
/// "+"; a rival counts when putting it in the effect's place costs less in χ² than noise would.
std::vector<std::string> scalar_alternatives(ScalarData& data, const CandidateList& list,
                                             const ScalarFit& fit,
                                             const Eigen::MatrixXd& covariance, std::size_t index);

}  // namespace plumbline
