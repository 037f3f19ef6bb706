// Lines that run through all dwells as mains pickup does, but come from elsewhere.
#pragma once

#include <memory>

#include "estimator/effects/driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// An angle of the head that swings: a servo that hunts. `angle`: δ or h.
std::unique_ptr<SmoothTerm> swinging_angle(double HeadGeometry::*angle);

/// By what of a recorded column a line is as strong as it is.
enum class StrengthBy { value, size };
/// A line of one axis that is as strong as a straight line of a recorded column, or of its size
/// where it takes both signs, says: a machine that runs or does not.
std::unique_ptr<SmoothTerm> line_of_column(DriverPointer column, StrengthBy by);

}  // namespace plumbline
