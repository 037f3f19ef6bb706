// What tilts the base, or the triad in its seat, towards a direction that lies nowhere near an
// axis.
#pragma once

#include <memory>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// `term`, shared between h and the base roll, or between the seat's two angles, as by a tilt
/// towards one direction, which is found with the rest: a base does not know in which direction the
/// spindle lies, nor a block how the triad stands in it. Precondition: `term` acts on kTilt or
/// kSeat.
std::unique_ptr<SmoothTerm> towards_a_direction(std::unique_ptr<SmoothTerm> term);

}  // namespace plumbline
