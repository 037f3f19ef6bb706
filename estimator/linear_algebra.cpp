#include "estimator/linear_algebra.h"

#include <cblas.h>

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

}  // namespace plumbline
