// How many positions does a calibration need, and which? Variances of the four parameters of an
// axis when every visit has the same independent error.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace plumbline {

/// All rows of A (n × 4, [a_x a_y a_z 1]), each once, the one next that the parameters learn most
/// from (the determinant of their information grows most: D-optimal, one at a time). Rows that add
/// nothing new while the parameters are still undetermined come by the direction they open.
std::vector<Eigen::Index> d_optimal_order(const Eigen::MatrixXd& A);

/// Standard uncertainty that the parameters leave in a measured component, RMS over the sphere of
/// directions, in units of a visit's error, after 1, 2, … of the rows in this order: √(tr Cov(K)/3
/// + Var(U_0)). Infinite before four directions are seen.
Eigen::VectorXd sphere_uncertainty(const Eigen::MatrixXd& A,
                                   const std::vector<Eigen::Index>& order);

}  // namespace plumbline
