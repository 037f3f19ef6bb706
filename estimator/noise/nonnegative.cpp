#include "estimator/noise/nonnegative.h"

#include <Eigen/Cholesky>
#include <array>
#include <limits>

namespace plumbline {

namespace {

constexpr int kUnknowns = 4;

}  // namespace

Eigen::Vector4d nonnegative_solution(const Eigen::Matrix4d& a, const Eigen::Vector4d& b,
                                     unsigned allowed) {
  Eigen::Vector4d best = Eigen::Vector4d::Zero();
  double best_value = std::numeric_limits<double>::infinity();
  for (unsigned subset = 1; subset < (1U << kUnknowns); ++subset) {
    if ((subset & ~allowed) != 0) continue;
    std::array<int, kUnknowns> index{};
    int size = 0;
    for (int i = 0; i < kUnknowns; ++i)
      if ((subset >> i & 1U) != 0) index[static_cast<std::size_t>(size++)] = i;
    Eigen::MatrixXd reduced(size, size);
    Eigen::VectorXd right(size);
    for (int i = 0; i < size; ++i) {
      right(i) = b(index[static_cast<std::size_t>(i)]);
      for (int j = 0; j < size; ++j)
        reduced(i, j) = a(index[static_cast<std::size_t>(i)], index[static_cast<std::size_t>(j)]);
    }
    // Powers differ by many decades: scale to a unit diagonal.
    const Eigen::VectorXd scale = reduced.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * reduced * scale.asDiagonal();
    const Eigen::VectorXd solution =
        scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(right)));
    if (!solution.allFinite() || solution.minCoeff() < 0) continue;
    const double value = 0.5 * solution.dot(reduced * solution) - right.dot(solution);
    if (value < best_value) {
      best_value = value;
      best.setZero();
      for (int i = 0; i < size; ++i) best(index[static_cast<std::size_t>(i)]) = solution(i);
    }
  }
  return best;
}

}  // namespace plumbline
