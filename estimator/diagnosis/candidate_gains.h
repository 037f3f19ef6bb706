// What every candidate would explain beside a fitted model.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/diagnosis/candidate_responses.h"

namespace plumbline {

/// The candidates that a more general one holds as special cases: whatever they may do to the means
/// beside the 12 parameters of a fit with the same whitening, to first order, it may do as well.
std::vector<std::size_t> special_cases(const CandidateResponses& responses, const EnlargedFit& fit,
                                       std::size_t general);

/// By how much each candidate would improve a fitted model, to first order.
class CandidateGains {
 public:
  /// Responses and fit belong to the same whitening and outlive this.
  CandidateGains(const CandidateResponses& responses, const EnlargedFit& fit);

  /// By how much each candidate would lower the sum of squares of the fit's residual.
  const Eigen::VectorXd& of_residual() const { return of_residual_; }
  /// The same of candidates as they stand: their amplitudes are not free.
  Eigen::VectorXd of_residual_as_they_stand() const;
  /// The same as of_residual() of `whitened` (stacked rows, free of what the model's parameters
  /// take up; one column a replicate): columns × candidates.
  Eigen::MatrixXd of(const Eigen::MatrixXd& whitened) const;
  /// Free directions of a candidate; 0 when the model absorbs it.
  int dof(std::size_t candidate) const { return static_cast<int>(transform_[candidate].rows()); }
  /// dof × columns; its product with the columns' amplitudes, squared, is what they would gain.
  const Eigen::MatrixXd& transform(std::size_t candidate) const { return transform_[candidate]; }
  /// Removes from each column what the model's parameters take up.
  Eigen::MatrixXd project(const Eigen::MatrixXd& whitened) const;
  /// The fit's model with a candidate (the one of this place) where the linear problem puts both.
  EnlargedParameters linear_start(std::size_t place, const Candidate& candidate) const;

  const EnlargedFit& fit() const { return fit_; }

 private:
  const CandidateResponses& responses_;
  const EnlargedFit& fit_;
  Eigen::MatrixXd model_basis_;  ///< stacked × p, orthonormal
  /// Of the fit, without what its last step left along the model, which a candidate that the model
  /// all but absorbs would be credited with many times over.
  Eigen::VectorXd residual_;
  std::vector<Eigen::MatrixXd> transform_;  ///< dof × columns: to orthonormal directions
  Eigen::VectorXd of_residual_;
};

/// What a model is fitted to.
struct FitInput {
  const VisitLog& log;
  const Observations& observed;
  const PoseWhitening& whitening;
};

/// The gains' fit with one more candidate, the one of this place. It starts with next to nothing of
/// it; where a place or a time constant runs from there to where it explains less than `promised`
/// to first order, also from where the linear problem puts it.
EnlargedFit fit_with_candidate(const FitInput& input, const CandidateGains& gains,
                               std::size_t place, const Candidate& candidate, double promised,
                               const FitLimits& limits = {});

}  // namespace plumbline
