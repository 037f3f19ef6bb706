// What the dense algebra of the core needs from OpenBLAS, which does Eigen's products.
#pragma once

#include <Eigen/Core>

namespace plumbline {

/// True when the OpenBLAS that was loaded may be called by several threads at once. The flavour
/// built without threads may not: its work buffers are shared without a lock, and products come out
/// wrong without a word. Debian chooses the flavour at run time (update-alternatives), so the
/// program asks instead of trusting the build.
bool linear_algebra_is_thread_safe();

/// Inverse of the positive definite n × n matrix with the Cholesky factor `lower`, whose strict
/// upper triangle is not looked at (LAPACK's dpotri: half the work of solving for the unit matrix).
Eigen::MatrixXd inverse_from_factor(Eigen::MatrixXd lower);

}  // namespace plumbline
