#include "estimator/noise/powers_posterior.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace plumbline {
namespace {

constexpr int kFirstSweeps = 100;  // forgotten
constexpr int kSweeps = 1000;

using Generator = std::mt19937_64;

double uniform(Generator& generator) { return std::generate_canonical<double, 53>(generator); }

/// A draw of x ≥ 0 with density ∝ x^(shape − 1)·exp(−½(x − mean)²), from a point `x` that is one.
/// x^shape is drawn, whose density has no pole.
double next_draw(double x, double mean, double shape, Generator& generator) {
  constexpr double kWidth = 1;  // of a slice, about
  constexpr double kNarrowest = 1e-9;
  const auto log_density = [&](double y) {
    const double away = std::pow(y, 1 / shape) - mean;
    return -0.5 * away * away;
  };
  const double y = std::pow(x, shape);
  const double level = log_density(y) + std::log1p(-uniform(generator));
  double low = y - kWidth * uniform(generator);
  double high = low + kWidth;
  while (low > 0 && log_density(low) > level) low -= kWidth;
  while (log_density(high) > level) high += kWidth;
  low = std::max(low, 0.0);
  while (high - low > kNarrowest) {
    const double drawn = low + (high - low) * uniform(generator);
    if (log_density(drawn) >= level) return std::pow(drawn, 1 / shape);
    (drawn < y ? low : high) = drawn;
  }
  return x;
}

}  // namespace

Eigen::MatrixXd covariance_of_powers(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  const Eigen::Index n = b.size();
  // In units of what each is known to, the others held.
  const Eigen::VectorXd scale =
      A.diagonal().unaryExpr([](double a) { return a > 0 ? 1 / std::sqrt(a) : 0; });
  const Eigen::MatrixXd scaled = scale.asDiagonal() * A * scale.asDiagonal();
  const Eigen::VectorXd right = scale.cwiseProduct(b);
  std::vector<Eigen::Index> uncertain;
  for (Eigen::Index i = 0; i < n; ++i)
    if (scale(i) > 0) uncertain.push_back(i);

  const double shape = 1 / static_cast<double>(std::max<std::size_t>(uncertain.size(), 1));
  Generator generator(1);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd draws(n, kSweeps);
  for (int sweep = -kFirstSweeps; sweep < kSweeps; ++sweep) {
    for (const Eigen::Index i : uncertain) {
      const double mean = x(i) + right(i) - scaled.col(i).dot(x);
      x(i) = next_draw(x(i), mean, shape, generator);
    }
    if (sweep >= 0) draws.col(sweep) = x;
  }
  draws.colwise() -= draws.rowwise().mean().eval();
  return scale.asDiagonal() * (draws * draws.transpose() / kSweeps) * scale.asDiagonal();
}

}  // namespace plumbline
