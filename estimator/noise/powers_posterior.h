// How well noise powers are known that cannot be negative.
#pragma once

#include <Eigen/Core>

namespace plumbline {

/// Covariance of n powers θ ≥ 0 of which ln L(θ) = b'θ − ½θ'Aθ is known, A (n×n, symmetric,
/// positive semidefinite) and b (n) in units of the powers. Powers with A_ii = 0 count as known.
/// The prior of each is Gamma distributed with shape 1/n and a wide scale, so that their sum has a
/// flat one and the prior of the whole noise does not hang on how finely it is divided into
/// processes: of the processes that could be there, few are. Gibbs sampling (Geman & Geman, IEEE
/// PAMI 6, 1984), each power by slices (Neal, Annals of Statistics 31, 2003); always the same
/// random numbers.
Eigen::MatrixXd covariance_of_powers(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

}  // namespace plumbline
