// What turns the triad on the turntable, or tilts the base, about no axis in particular.
#pragma once

#include <memory>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// `term` about an axis of its own, which is found with the rest: each of its amplitudes three
/// times, about x, y and z of the triad. A block that turns does not know how the triad stands in
/// it. Precondition: `term` acts on kSeat.
std::unique_ptr<SmoothTerm> about_some_axis(std::unique_ptr<SmoothTerm> term);

/// `term` with each of its amplitudes twice, for h and for the base roll: what need not stay in one
/// direction while it goes to and fro. Precondition: `term` acts on kTilt.
std::unique_ptr<SmoothTerm> in_both_directions(std::unique_ptr<SmoothTerm> term);

}  // namespace plumbline
