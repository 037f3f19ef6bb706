#include "estimator/position_design.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace plumbline {

std::vector<Eigen::Index> d_optimal_order(const Eigen::MatrixXd& A) {
  // So little is known at first that every direction counts, and nothing of it is left later.
  constexpr double kAtFirst = 1e-8;
  Eigen::Matrix4d information = Eigen::Matrix4d::Identity() * kAtFirst;
  std::vector<Eigen::Index> left(static_cast<std::size_t>(A.rows()));
  for (std::size_t k = 0; k < left.size(); ++k) left[k] = static_cast<Eigen::Index>(k);
  std::vector<Eigen::Index> order;
  while (!left.empty()) {
    const Eigen::LLT<Eigen::Matrix4d> known(information);
    auto best = left.begin();
    double most = -1;
    for (auto it = left.begin(); it != left.end(); ++it) {
      const Eigen::Vector4d row = A.row(*it).transpose();
      const double gain = row.dot(known.solve(row));
      // Equal ones in the order of the grid, whatever the last bits say.
      if (gain > most * (1 + 1e-9)) {
        most = gain;
        best = it;
      }
    }
    const Eigen::Vector4d row = A.row(*best).transpose();
    information += row * row.transpose();
    order.push_back(*best);
    left.erase(best);
  }
  return order;
}

Eigen::VectorXd sphere_uncertainty(const Eigen::MatrixXd& A,
                                   const std::vector<Eigen::Index>& order) {
  Eigen::VectorXd result(std::ssize(order));
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  for (Eigen::Index n = 0; n < result.size(); ++n) {
    const Eigen::Vector4d row = A.row(order[static_cast<std::size_t>(n)]).transpose();
    information += row * row.transpose();
    const Eigen::FullPivLU<Eigen::Matrix4d> lu(information);
    if (!lu.isInvertible()) {
      result(n) = std::numeric_limits<double>::infinity();
      continue;
    }
    const Eigen::Matrix4d covariance = lu.inverse();
    result(n) = std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3 + covariance(3, 3));
  }
  return result;
}

}  // namespace plumbline
