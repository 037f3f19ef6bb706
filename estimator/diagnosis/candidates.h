// Every hypothesis that a search looks at, as directions in the space of whitened residuals.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "estimator/diagnosis/enlarged_model.h"

namespace plumbline {

/// One hypothesis of one effect on one axis (or the head).
struct Candidate {
  const Effect* effect = nullptr;
  std::size_t axis = 0;
  Hypothesis hypothesis;
  std::size_t family = 0;  ///< hypotheses that differ only in shapes and indices share one
  double handicap = 0;     ///< log-probability by which it must beat those without

  ActiveEffect active() const { return activate(*effect, axis, hypothesis); }
};

/// All hypotheses on these visits. Owns the effects that exist for these data only (recorded
/// columns, smooth terms), so it must outlive every model that they became part of.
struct CandidateList {
  std::vector<Candidate> candidates;
  std::vector<std::size_t> family_size;
  std::vector<std::shared_ptr<const Effect>> owned;
};

/// Adds all hypotheses of one effect.
void add_candidates(CandidateList& list, const VisitLog& log, const Effect& effect,
                    double handicap = 0);

/// The catalogue, every recorded column, and smooth terms in every variable. A term without a name
/// must be e^7 times as likely as one with a name: a polynomial can imitate much.
CandidateList all_candidates(const VisitLog& log);

/// What each candidate would add to a fitted model, orthonormal and free of everything that the
/// model's own parameters can take up.
class CandidateDirections {
 public:
  /// `fit` is the model so far; directions are taken at its parameters.
  CandidateDirections(const VisitLog& log, const CandidateList& list,
                      const PoseWhitening& whitening, const EnlargedFit& fit);

  /// By how much each candidate would lower the sum of squares of `whitened` (3n rows; one column a
  /// replicate): candidates × columns, to first order.
  Eigen::MatrixXd gains(const Eigen::MatrixXd& whitened) const;
  /// Free directions of a candidate; 0 when the model absorbs it.
  int dof(std::size_t candidate) const { return dof_[candidate]; }
  /// Removes from each column what the model's parameters take up.
  Eigen::MatrixXd project(const Eigen::MatrixXd& whitened) const;

 private:
  Eigen::MatrixXd model_basis_;  ///< 3n × p, orthonormal
  Eigen::MatrixXd basis_;        ///< 3n × Σ dof
  std::vector<int> dof_;
  std::vector<Eigen::Index> first_;
};

}  // namespace plumbline
