// Every hypothesis that a search looks at, as directions in the space of whitened residuals.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "estimator/diagnosis/enlarged_fit.h"

namespace plumbline {

/// A term without a name must be e^7 times as likely as one with a name: a polynomial can imitate
/// much.
inline constexpr double kHandicapOfUnnamed = 7;
/// Which of some forty names it is, is one more choice for every name more, in χ².
inline constexpr double kOfForty = 7.4;

/// One amplitude of a hypothesis, the others at zero; of shapes and indices alone the hypothesis.
struct SingleAmplitude {
  ActiveEffect active;
  std::vector<double> number;  ///< numbers_of_visits()
};

/// One hypothesis of one effect on one axis (or the head).
struct Candidate {
  const Effect* effect = nullptr;
  std::size_t axis = 0;
  Hypothesis hypothesis;
  std::size_t family = 0;  ///< hypotheses that differ only in shapes and indices share one
  double handicap = 0;     ///< log-probability by which it must beat those without
  /// Single readings of a coarse converter stray further than Gaussian noise does.
  bool of_one_coarse_reading = false;
  /// Worked out in advance for a candidate that is looked at in many models.
  std::shared_ptr<const std::vector<SingleAmplitude>> singles = {};

  bool has_name() const { return handicap == 0; }
  /// The same effect with another hypothesis.
  Candidate with(Hypothesis other) const {
    Candidate candidate = *this;
    candidate.hypothesis = std::move(other);
    candidate.singles = nullptr;
    return candidate;
  }
  ActiveEffect active() const { return activate(*effect, axis, hypothesis); }
};

/// All hypotheses on these visits. Owns the effects that exist for these data only (recorded
/// columns, smooth terms), so it must outlive every model that they became part of.
struct CandidateList {
  std::vector<Candidate> candidates;
  std::vector<std::size_t> family_size;
  std::vector<std::shared_ptr<const Effect>> owned;
};

/// Independent looks where one effect is asked of the axes only: its hypotheses on each.
double looks_on_axes(const CandidateList& list, const Candidate& candidate);

/// Adds all hypotheses of one effect.
void add_candidates(CandidateList& list, const VisitLog& log, const Effect& effect,
                    double handicap = 0);

/// Whether what an axis does from code to code, which has a name where the codes of this log prove
/// it, leaves over what looks like this: it repeats itself with what is measured, too.
bool imitates_proven_rounding(const VisitLog& log, const Effect& effect);

/// The catalogue, every recorded column, smooth terms in every variable, and the user's `own`
/// effects.
CandidateList all_candidates(const VisitLog& log,
                             const std::vector<std::shared_ptr<const Effect>>& own = {});

/// What each candidate would add to the whitened observations. A sensor effect moves one axis only,
/// so its columns hold n rows; those of the head hold 3n; what changes within the dwell has rows
/// for the contrasts besides.
struct CandidateResponses {
  struct Group {
    Eigen::Index first_row = 0;  ///< of `means` among the stacked rows
    Eigen::MatrixXd means;
    Eigen::Index first_dwell_row = 0;
    Eigen::MatrixXd dwells;  ///< no rows for what is constant within the dwell
    /// Products of the columns with a stacked matrix, columns × its columns.
    Eigen::MatrixXd products(const Eigen::MatrixXd& stacked) const;
  };
  struct Place {
    std::size_t group = 0;
    Eigen::Index first = 0;
    Eigen::Index count = 0;
  };
  /// x, y, z; x, y, z within the dwell; head; head within the dwell.
  std::array<Group, 2 * kAxisCount + 2> groups;
  std::vector<Place> place;  ///< one per candidate
};

/// One column for each amplitude of each candidate, at the parameters of `model`.
CandidateResponses candidate_responses(const VisitLog& log, const CandidateList& list,
                                       const PoseWhitening& whitening,
                                       const EnlargedParameters& model);

/// The same before they are whitened, V.
CandidateResponses candidate_responses_V(const VisitLog& log, const CandidateList& list,
                                         const EnlargedParameters& model);
CandidateResponses whitened(CandidateResponses responses_V, const VisitLog& log,
                            const PoseWhitening& whitening);
/// Those of some of the candidates.
CandidateResponses some_of(const CandidateResponses& responses,
                           const std::vector<std::size_t>& candidates);

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
  Eigen::VectorXd of_residual() const { return of(residual_).col(0); }
  /// The same of candidates as they stand: their amplitudes are not free.
  Eigen::VectorXd of_residual_as_they_stand() const;
  /// The same as of_residual() of `whitened` (stacked rows, free of what the model's parameters
  /// take up; one column a replicate): candidates × columns.
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
