// The head still moving while the sensor is read, without a name.
#pragma once

#include <memory>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// What the angle that decays is proportional to.
enum class DecayOf { one, weight, way };

/// c·exp(−(time since arrival)/τ) added to δ or h, less c where the angle was right on arrival and
/// wanders off: the same after every move, or times the cosine of h (a weight that sinks), or times
/// the way that this angle has just turned.
std::unique_ptr<SmoothTerm> head_decay(double HeadGeometry::*angle, DecayOf of);

/// A sine that every arrival sets off in δ or h and that dies away (effect::ringing()).
std::unique_ptr<SmoothTerm> head_ringing(double HeadGeometry::*angle);

}  // namespace plumbline
