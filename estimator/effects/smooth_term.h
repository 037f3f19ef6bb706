// Structure that has no name: a smooth function of some variable that the rig knows or recorded.
// It takes part in the search like any effect and is reported with its driver and form.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {

/// What a smooth term changes.
enum class TermForm { bias, scale, geometry };
const char* to_string(TermForm form);

/// A polynomial (Legendre, degree 1 … d) or, for the spindle angle, a harmonic series (order
/// 1 … d) in one variable. The range in which the variable was seen is part of its parameters, so
/// that it means the same on another set; beyond that range it is held.
class SmoothTerm : public Effect {
 public:
  virtual const std::string& driver() const = 0;  ///< "t_s", "rh_pct", "temp_C.rate" …
  virtual TermForm form() const = 0;
  virtual std::string shape() const = 0;  ///< "polynomial of degree 2" …
};

/// All smooth terms that can be formed on these visits: for every variable, form and degree.
std::vector<std::unique_ptr<SmoothTerm>> smooth_terms(const VisitLog& log);

}  // namespace plumbline
