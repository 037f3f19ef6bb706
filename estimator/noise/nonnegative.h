// Quadratic minimum over nonnegative noise powers.
#pragma once

#include <Eigen/Core>

namespace plumbline {

/// argmin ½θ'Aθ − b'θ over θ ≥ 0, with θ_i = 0 where bit i of `allowed` is not set. A symmetric,
/// positive semidefinite. Exact: with four unknowns every choice of zeros is tried.
Eigen::Vector4d nonnegative_solution(const Eigen::Matrix4d& a, const Eigen::Vector4d& b,
                                     unsigned allowed);

}  // namespace plumbline
