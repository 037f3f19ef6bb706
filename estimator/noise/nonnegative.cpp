#include "estimator/noise/nonnegative.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
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

Eigen::VectorXd nonnegative_solution(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                                     const std::vector<bool>& allowed) {
  constexpr int kSweeps = 2000;
  const Eigen::Index n = b.size();
  // Powers differ by many decades: scale to a unit diagonal.
  Eigen::VectorXd scale(n);
  for (Eigen::Index i = 0; i < n; ++i)
    scale(i) = allowed[static_cast<std::size_t>(i)] && a(i, i) > 0 ? 1 / std::sqrt(a(i, i)) : 0;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * a * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(b);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd gradient = -right;  // scaled·x − right
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    double moved = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!(scale(i) > 0)) continue;
      const double step = std::max(-gradient(i), -x(i));
      if (step == 0) continue;
      x(i) += step;
      gradient += step * scaled.col(i);
      moved = std::max(moved, std::abs(step));
    }
    if (moved <= 1e-9 * x.maxCoeff()) break;
  }
  return scale.cwiseProduct(x);
}

}  // namespace plumbline
