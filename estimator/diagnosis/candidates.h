// Every hypothesis that a search looks at.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <utility>
#include <vector>

#include "estimator/diagnosis/enlarged_parameters.h"

namespace plumbline {

/// A term without a name must be e^7 times as likely as one with a name: a polynomial can imitate
/// much.
inline constexpr double kHandicapOfUnnamed = 7;
/// Which of some forty names it is, is one more choice for every name more, in χ².
inline constexpr double kOfForty = 7.4;

/// One amplitude of a hypothesis, the others at zero; of shapes and indices alone the hypothesis.
/// With what it does whatever the model is.
struct SingleAmplitude {
  /// What displace() adds to one of kHeadAngles at every visit, rad; to the lift its share.
  struct Displacement {
    Eigen::Index angle;
    Eigen::VectorXd by;
  };
  /// Contrasts of the course of one of kHeadAngles within the dwells, n × their number.
  struct Course {
    Eigen::Index angle = 0;
    Eigen::MatrixXd contrasts_rad;
  };

  std::vector<double> p;                ///< in the order of effect->parameters()
  std::vector<double> number;           ///< sensor: numbers_of_visits()
  std::vector<Displacement> displaced;  ///< head
  Course course;                        ///< head, within the dwell
};
/// Those of a hypothesis, in the order of its amplitudes.
std::vector<SingleAmplitude> single_amplitudes(const VisitLog& log, const ActiveEffect& active);

/// One hypothesis of one effect on one axis (or the head).
struct Candidate {
  const Effect* effect = nullptr;
  std::size_t axis = 0;
  Hypothesis hypothesis;
  std::size_t family = 0;  ///< hypotheses that differ only in shapes and indices share one
  double handicap = 0;     ///< log-probability by which it must beat those without
  /// Single readings of a coarse converter stray further than Gaussian noise does.
  bool of_one_coarse_reading = false;
  /// Worked out in advance for a candidate that is looked at in many models; axes of which the
  /// visits make the same share them.
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

}  // namespace plumbline
