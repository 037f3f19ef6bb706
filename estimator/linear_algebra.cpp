#include "estimator/linear_algebra.h"

#include <cblas.h>
#include <malloc.h>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cassert>
#include <climits>
#include <cstdlib>
#include <limits>
#include <string>
#include <string_view>

// OpenBLAS holds LAPACK, too; its header is a package of its own.
extern "C" void dpotri_(const char* triangle, const int* n, double* a, const int* lda, int* info);
extern "C" void dtrtri_(const char* triangle, const char* diagonal, const int* n, double* a,
                        const int* lda, int* info);

namespace plumbline {
namespace {

// Before main(): parallel_for() shares out the work, and a product must not depend on the number of
// cores.
const bool kThreadSafe = [] {
  openblas_set_num_threads(1);
  return openblas_get_parallel() != OPENBLAS_SEQUENTIAL;
}();

// Matrices of megabytes come and go all the time. Given back to the kernel each time, their memory
// would have to be mapped and zeroed again for the next: a sixth of the time of a diagnosis.
[[maybe_unused]] const bool kMemoryIsKept = [] {
  constexpr int kLargestOnHeap = 32 << 20;  // as much as glibc allows
  constexpr int kKept = 1 << 30;
  return mallopt(M_MMAP_THRESHOLD, kLargestOnHeap) == 1 && mallopt(M_TRIM_THRESHOLD, kKept) == 1;
}();

}  // namespace

bool linear_algebra_is_thread_safe() { return kThreadSafe; }

void start_with_kernels_for_processor(char* const* arguments) {
#ifdef __x86_64__
  constexpr const char* kChoice = "OPENBLAS_CORETYPE";
  if (std::string_view(openblas_get_corename()) != "Prescott" || std::getenv(kChoice) != nullptr ||
      !__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
    return;
  // By its own name, under which it is looked for among the processes.
  std::string program(PATH_MAX, '\0');
  const ssize_t length = readlink("/proc/self/exe", program.data(), program.size());
  if (length <= 0 || setenv(kChoice, "Haswell", 1) != 0) return;
  program.resize(static_cast<std::size_t>(length));
  execv(program.c_str(), arguments);
#else
  static_cast<void>(arguments);
#endif
}

Eigen::MatrixXd inverse_from_factor(Eigen::MatrixXd lower) {
  const int n = static_cast<int>(lower.rows());
  int info = 0;
  dpotri_("L", &n, lower.data(), &n, &info);
  assert(info == 0);
  lower.triangularView<Eigen::StrictlyUpper>() = lower.transpose();
  return lower;
}

Eigen::MatrixXd inverse_of_triangle(Eigen::MatrixXd lower) {
  const int n = static_cast<int>(lower.rows());
  int info = 0;
  dtrtri_("L", "N", &n, lower.data(), &n, &info);
  if (info != 0) lower.setConstant(std::numeric_limits<double>::quiet_NaN());
  return lower;
}

double propagated_variance(const Eigen::MatrixXd& information, const Eigen::VectorXd& slope) {
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(slope);
  return right.dot(scaled.ldlt().solve(right));
}

Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& columns) {
  const Eigen::RowVectorXd scale = columns.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(columns * scale.asDiagonal());
  qr.setThreshold(1e-8);
  return qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), qr.rank());
}

}  // namespace plumbline
