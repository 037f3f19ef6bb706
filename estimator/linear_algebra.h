// What the dense algebra of the core needs from OpenBLAS, which does Eigen's products, and of the
// memory that its matrices live in.
#pragma once

#include <Eigen/Core>

namespace plumbline {

/// True when the OpenBLAS that was loaded may be called by several threads at once. The flavour
/// built without threads may not: its work buffers are shared without a lock, and products come out
/// wrong without a word. Debian chooses the flavour at run time (update-alternatives), so the
/// program asks instead of trusting the build.
bool linear_algebra_is_thread_safe();

/// To be called first in main(), with its `arguments`: starts the program once more where OpenBLAS,
/// which chooses its kernels while it is loaded, did not know the processor. For one that is
/// younger than itself it falls back to kernels of 2004 (Prescott, SSE3); with those for AVX2 or
/// AVX-512 a calibration takes three quarters of the time. Returns where there is nothing to gain,
/// the user has chosen (OPENBLAS_CORETYPE), or the program cannot be started again.
void start_with_kernels_for_processor(char* const* arguments);

/// Inverse of the positive definite n × n matrix with the Cholesky factor `lower`, whose strict
/// upper triangle is not looked at.
Eigen::MatrixXd inverse_from_factor(Eigen::MatrixXd lower);

/// Inverse of a lower triangular n × n matrix whose strict upper triangle is zero; all NaN where
/// there is none.
Eigen::MatrixXd inverse_of_triangle(Eigen::MatrixXd lower);

/// columns ← lower·columns in place, of an n × n lower triangle (what is above is not looked at)
/// and n × any.
void multiply_by_triangle(const Eigen::Ref<const Eigen::MatrixXd>& lower,
                          Eigen::Ref<Eigen::MatrixXd> columns);

/// slope'·information⁻¹·slope: the variance of what depends with this slope on parameters of this
/// information. The scales of the parameters may differ by many orders of magnitude.
double propagated_variance(const Eigen::MatrixXd& information, const Eigen::VectorXd& slope);

/// How many rows there are up to the last that is not all zeros, at least as many as columns: a
/// model that moves means only leaves those of the dwells at zero, and factoring them takes most of
/// the time.
Eigen::Index rows_in_use(const Eigen::MatrixXd& columns);

/// Orthonormal basis, n × rank, of what the columns span, each brought to length 1 first. Columns
/// that depend on the others to within 1e-8 add nothing.
Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& columns);

}  // namespace plumbline
