// Angles are degrees and arc seconds where people read them, radians where they are computed with.
#pragma once

#include <numbers>

namespace plumbline {

inline constexpr double kRadPerDeg = std::numbers::pi / 180;
inline constexpr double kDegPerRad = 180 / std::numbers::pi;
inline constexpr double kRadPerArcsec = kRadPerDeg / 3600;

}  // namespace plumbline
