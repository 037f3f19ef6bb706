#pragma once

namespace plumbline {

inline double square(double x) { return x * x; }

}  // namespace plumbline
