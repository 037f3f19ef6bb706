// The head still moving while the sensor is read, without a name.
#pragma once

#include <memory>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// What the angle that dies away is proportional to: the same after every move; the cosine of h (a
/// weight that sinks); the way that this angle has just turned, or the direction in which it turned
/// last.
enum class SetOffBy { arrival, weight, way, direction };

/// c·exp(−(time since arrival)/τ) added to δ or h, less c where the angle was right on arrival and
/// wanders off, less its mean over the dwell where it is right on average.
std::unique_ptr<SmoothTerm> head_decay(double HeadGeometry::*angle, SetOffBy by);

/// A sine that every arrival sets off in δ or h and that dies away (effect::ringing()).
std::unique_ptr<SmoothTerm> head_ringing(double HeadGeometry::*angle, SetOffBy by);

}  // namespace plumbline
