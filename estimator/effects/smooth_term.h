// Structure that has no name: a smooth function of some variable that the rig knows or recorded.
// It takes part in the search like any effect and is reported with its driver and form.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {

/// What a smooth term changes.
enum class TermForm { bias, scale, geometry, sample };
const char* to_string(TermForm form);

/// A function of one variable with free coefficients: a polynomial, a harmonic series, a wave, a
/// bell, a train of pulses, a bend, a step, a decay, a play, friction, or a course over the dwell;
/// of the variable as it is or of what it was on average lately. What is sharp has a shape of its
/// own, so that the rest of it is not taken for effects with a name. The range in which the
/// variable was seen is part of its parameters, so that it means the same on another set.
class SmoothTerm : public Effect {
 public:
  virtual const std::string& driver() const = 0;  ///< "t_s", "rh_pct", "temp_C.rate" …
  virtual TermForm form() const = 0;
  /// "polynomial of degree 2" …; with driver and form it says which term this is.
  virtual std::string shape() const = 0;
  /// ln of how many there are to choose among, where hypotheses() has one that stands for them.
  virtual double log_choices() const { return 0; }
  bool is(const std::string& driver, const std::string& form, const std::string& shape) const;
};

/// Which of them make sense: a search wants those that these visits can show, a model that is read
/// back wants any.
enum class SmoothTermSelection { shown_by_these_visits, any };

/// The smooth terms for every variable, form and shape. They hold the variables at the visits of
/// `log` and can be used with that log only.
std::vector<std::unique_ptr<SmoothTerm>> smooth_terms(const VisitLog& log,
                                                      SmoothTermSelection selection);

/// The first of that driver, form and shape, null if there is none. Terms that share all three
/// differ in how they are searched for, not in what they say.
const SmoothTerm* find_term(const std::vector<std::unique_ptr<SmoothTerm>>& terms,
                            const std::string& driver, const std::string& form,
                            const std::string& shape);

}  // namespace plumbline
