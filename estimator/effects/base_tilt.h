// What tilts the base towards a direction that lies nowhere near an axis.
#pragma once

#include <memory>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// `term`, shared between h and the base roll as by a tilt towards one direction, which is found
/// with the rest: a base does not know in which direction the spindle lies. Precondition: `term`
/// acts on kTilt.
std::unique_ptr<SmoothTerm> towards_a_direction(std::unique_ptr<SmoothTerm> term);

}  // namespace plumbline
