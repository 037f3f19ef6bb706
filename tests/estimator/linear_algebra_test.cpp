#include "estimator/linear_algebra.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstddef>

namespace plumbline {
namespace {

/// Doubles of which nothing beyond the last may be read.
class GuardedDoubles {
 public:
  explicit GuardedDoubles(Eigen::Index count)
      : page_(static_cast<std::size_t>(sysconf(_SC_PAGESIZE))),
        size_((static_cast<std::size_t>(count) * sizeof(double) / page_ + 2) * page_),
        begin_(mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) {
    std::byte* end = static_cast<std::byte*>(begin_) + size_ - page_;
    EXPECT_EQ(mprotect(end, page_, PROT_NONE), 0);
    data_ = reinterpret_cast<double*>(end) - count;
    std::fill_n(data_, count, 0.5);
  }
  ~GuardedDoubles() { munmap(begin_, size_); }
  GuardedDoubles(const GuardedDoubles&) = delete;
  GuardedDoubles& operator=(const GuardedDoubles&) = delete;
  double* data() { return data_; }

 private:
  std::size_t page_, size_;
  void* begin_;
  double* data_ = nullptr;
};

// OpenBLAS's dsymv does, on processors that it does not know, and where a page of memory ends there
// the program ends, too: three times in some thousands of sets.
TEST(LinearAlgebra, ReadsNothingBeyondItsOperands) {
  ASSERT_TRUE(linear_algebra_is_thread_safe());
  for (Eigen::Index n = 1; n <= 70; ++n) {
    GuardedDoubles a(n * n), b(n * n), x(n), y(n);
    Eigen::Map<Eigen::MatrixXd> A(a.data(), n, n), B(b.data(), n, n);
    Eigen::Map<Eigen::VectorXd> u(x.data(), n), v(y.data(), n);
    A.diagonal().array() += static_cast<double>(n);
    const double row = static_cast<double>(n) + 0.5 * static_cast<double>(n);
    v.noalias() = A.selfadjointView<Eigen::Lower>() * u;
    EXPECT_NEAR(v(n - 1), 0.5 * row, 1e-9);
    v.noalias() = A.selfadjointView<Eigen::Upper>() * u;
    EXPECT_NEAR(v(0), 0.5 * row, 1e-9);
    v.noalias() = A * u;
    EXPECT_NEAR(v(0), 0.5 * row, 1e-9);
    v.noalias() = A.transpose() * u;
    EXPECT_NEAR(v(0), 0.5 * row, 1e-9);
    B.noalias() = A * A.transpose();
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(A);
    ASSERT_EQ(factor.info(), Eigen::Success);
    factor.matrixL().solveInPlace(u);
    factor.matrixL().solveInPlace(B);
    EXPECT_TRUE(B.allFinite() && u.allFinite());
  }
}

}  // namespace
}  // namespace plumbline
