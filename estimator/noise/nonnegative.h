// Quadratic minimum over nonnegative noise powers.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// argmin ½θ'Aθ − b'θ over θ ≥ 0, with θ_i = 0 where bit i of `allowed` is not set. A symmetric,
/// positive semidefinite. Exact: with four unknowns every choice of zeros is tried.
Eigen::Vector4d nonnegative_solution(const Eigen::Matrix4d& a, const Eigen::Vector4d& b,
                                     unsigned allowed);

/// The same for any number of unknowns, by descent in one coordinate after the other; exact to a
/// part in 1e9 of the value reached.
Eigen::VectorXd nonnegative_solution(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                                     const std::vector<bool>& allowed);

}  // namespace plumbline
