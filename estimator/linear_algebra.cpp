#include "estimator/linear_algebra.h"

#include <cblas.h>
#include <malloc.h>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <climits>
#include <cstdlib>
#include <limits>
#include <string>
#include <string_view>
#include <thread>

// OpenBLAS holds LAPACK, too; its header is a package of its own.
extern "C" void dlauum_(const char* triangle, const int* n, double* a, const int* lda, int* info);

namespace plumbline {
namespace {

// Before main(): parallel_for() shares out the work, and a product must not depend on the number of
// cores.
const bool kThreadSafe = [] {
  openblas_set_num_threads(1);
  return openblas_get_parallel() != OPENBLAS_SEQUENTIAL;
}();

// Matrices of megabytes come and go all the time. Given back to the kernel each time, their memory
// would have to be mapped and zeroed again for the next: a sixth of the time of a diagnosis. No
// more pools than threads that work at a time: others begin their own, and what was left in those
// that have ended lies idle.
[[maybe_unused]] const bool kMemoryIsKept = [] {
  constexpr int kLargestOnHeap = 32 << 20;  // as much as glibc allows
  constexpr int kKept = 1 << 30;
  const int pools = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  return mallopt(M_MMAP_THRESHOLD, kLargestOnHeap) == 1 && mallopt(M_TRIM_THRESHOLD, kKept) == 1 &&
         mallopt(M_ARENA_MAX, pools) == 1;
}();

}  // namespace

bool linear_algebra_is_thread_safe() { return kThreadSafe; }

void start_with_kernels_for_processor(char* const* arguments) {
#ifdef __x86_64__
  constexpr const char* kChoice = "OPENBLAS_CORETYPE";
  if (std::string_view(openblas_get_corename()) != "Prescott" || std::getenv(kChoice) != nullptr ||
      !__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
    return;
  const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                          __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  // By its own name, under which it is looked for among the processes.
  std::string program(PATH_MAX, '\0');
  const ssize_t length = readlink("/proc/self/exe", program.data(), program.size());
  if (length <= 0 || setenv(kChoice, has_avx512 ? "SkylakeX" : "Haswell", 1) != 0) return;
  program.resize(static_cast<std::size_t>(length));
  execv(program.c_str(), arguments);
#else
  static_cast<void>(arguments);
#endif
}

namespace {

/// columns ← factor·(lower·columns), or factor·(columns·lower) from the right, in place.
void multiply(CBLAS_SIDE side, double factor, const Eigen::Ref<const Eigen::MatrixXd>& lower,
              Eigen::Ref<Eigen::MatrixXd> columns) {
  cblas_dtrmm(CblasColMajor, side, CblasLower, CblasNoTrans, CblasNonUnit,
              static_cast<blasint>(columns.rows()), static_cast<blasint>(columns.cols()), factor,
              lower.data(), static_cast<blasint>(lower.outerStride()), columns.data(),
              static_cast<blasint>(columns.outerStride()));
}

/// By halves: LAPACK's dtrtri takes twice to four times as long in OpenBLAS, which leaves most of
/// it to products with single vectors.
void invert_triangle(Eigen::Ref<Eigen::MatrixXd> lower) {
  constexpr Eigen::Index kSmall = 24;
  const Eigen::Index n = lower.rows(), half = n / 2, rest = n - half;
  if (n <= kSmall) {
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(n, n);
    lower = lower.triangularView<Eigen::Lower>().solve(unit).eval();
    return;
  }
  invert_triangle(lower.topLeftCorner(half, half));
  invert_triangle(lower.bottomRightCorner(rest, rest));
  multiply(CblasLeft, -1, lower.bottomRightCorner(rest, rest), lower.bottomLeftCorner(rest, half));
  multiply(CblasRight, 1, lower.topLeftCorner(half, half), lower.bottomLeftCorner(rest, half));
}

}  // namespace

Eigen::MatrixXd inverse_from_factor(Eigen::MatrixXd lower) {
  invert_triangle(lower);
  const int n = static_cast<int>(lower.rows());
  int info = 0;
  dlauum_("L", &n, lower.data(), &n, &info);
  assert(info == 0);
  lower.triangularView<Eigen::StrictlyUpper>() = lower.transpose();
  return lower;
}

Eigen::MatrixXd inverse_of_triangle(Eigen::MatrixXd lower) {
  if ((lower.diagonal().array() != 0).all())
    invert_triangle(lower);
  else
    lower.setConstant(std::numeric_limits<double>::quiet_NaN());
  return lower;
}

void multiply_by_triangle(const Eigen::Ref<const Eigen::MatrixXd>& lower,
                          Eigen::Ref<Eigen::MatrixXd> columns) {
  if (columns.cols() == 1)  // a triangle that is first packed for products takes twice as long
    cblas_dtrmv(CblasColMajor, CblasLower, CblasNoTrans, CblasNonUnit,
                static_cast<blasint>(lower.rows()), lower.data(),
                static_cast<blasint>(lower.outerStride()), columns.data(), 1);
  else
    multiply(CblasLeft, 1, lower, columns);
}

double propagated_variance(const Eigen::MatrixXd& information, const Eigen::VectorXd& slope) {
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(slope);
  return right.dot(scaled.ldlt().solve(right));
}

Eigen::Index rows_in_use(const Eigen::MatrixXd& columns) {
  Eigen::Index rows = columns.rows();
  while (rows > columns.cols() && (columns.row(rows - 1).array() == 0).all()) --rows;
  return rows;
}

Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& columns) {
  const Eigen::Index rows = rows_in_use(columns);
  const Eigen::RowVectorXd scale = columns.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(columns.topRows(rows) * scale.asDiagonal());
  qr.setThreshold(1e-8);
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(columns.rows(), qr.rank());
  basis.topRows(rows) = qr.householderQ() * Eigen::MatrixXd::Identity(rows, qr.rank());
  return basis;
}

}  // namespace plumbline
