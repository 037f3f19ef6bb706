#include "estimator/linear_algebra.h"

#include <cblas.h>

#include <cassert>

// OpenBLAS holds LAPACK, too; its header is a package of its own.
extern "C" void dpotri_(const char* triangle, const int* n, double* a, const int* lda, int* info);

namespace plumbline {
namespace {

// Before main(): parallel_for() shares out the work, and a product must not depend on the number of
// cores.
const bool kThreadSafe = [] {
  openblas_set_num_threads(1);
  return openblas_get_parallel() != OPENBLAS_SEQUENTIAL;
}();

}  // namespace

bool linear_algebra_is_thread_safe() { return kThreadSafe; }

Eigen::MatrixXd inverse_from_factor(Eigen::MatrixXd lower) {
  const int n = static_cast<int>(lower.rows());
  int info = 0;
  dpotri_("L", &n, lower.data(), &n, &info);
  assert(info == 0);
  lower.triangularView<Eigen::StrictlyUpper>() = lower.transpose();
  return lower;
}

}  // namespace plumbline
