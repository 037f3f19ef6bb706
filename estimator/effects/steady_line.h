// Lines that run through all dwells as mains pickup does, but come from elsewhere.
#pragma once

#include <memory>

#include "estimator/effects/driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// An angle of the head that swings: a servo that hunts; or a base that is shaken: to and fro,
/// which is to the triad as if it swung, or up and down. `angle`: one of kSwinging.
std::unique_ptr<SmoothTerm> swinging_angle(double HeadGeometry::*angle);

/// By what of a driver a line is as strong as it is: a straight line in it or, where it takes both
/// signs, in its size, or a parabola.
enum class StrengthBy { value, size, square };
/// A line of one axis that is as strong as a driver says: a machine that runs or does not; a
/// shaking that an axis sees the more, the more it lies along it.
std::unique_ptr<SmoothTerm> line_of_driver(DriverPointer driver, StrengthBy by);

}  // namespace plumbline
