#include "estimator/fit/generalised_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include "estimator/fit/least_squares.h"
#include "estimator/kinematics.h"
#include "estimator/linear_algebra.h"

namespace plumbline {
namespace {

// Angles are commanded to a thousandth of a degree at best; anything below is rounding.
constexpr double kRankTolerance = 1e-8;

int rank_of(const Eigen::VectorXd& singular_values) {
  int rank = 0;
  for (const double value : singular_values)
    if (value > kRankTolerance * singular_values(0)) ++rank;
  return rank;
}

Eigen::JacobiSVD<Eigen::MatrixXd> scaled_svd(const Eigen::MatrixXd& design) {
  Eigen::VectorXd norm = design.colwise().norm();
  for (double& value : norm)
    if (value < kRankTolerance * design.norm()) value = 1;
  return Eigen::JacobiSVD<Eigen::MatrixXd>(design * norm.cwiseInverse().asDiagonal());
}

/// Names of the directions that a design of lower rank leaves open.
std::string undetermined_directions(const Eigen::MatrixXd& design, int rank) {
  if (design.rows() == 1) return "all parameters: there is only one pose";
  const double tolerance = kRankTolerance * std::sqrt(static_cast<double>(design.rows()));
  const Eigen::RowVectorXd spread = (design.rowwise() - design.row(0)).colwise().norm();
  if (spread.maxCoeff() < tolerance) return "all parameters: all poses are equal";

  std::string text;
  int named = 0;
  const auto add = [&](const std::string& words) {
    if (!text.empty()) text += "; ";
    text += words;
    ++named;
  };
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const std::string scale = std::string("K_") + kAxisName[static_cast<std::size_t>(axis)];
    const std::string force = std::string("a_") + kAxisName[static_cast<std::size_t>(axis)];
    if (design.col(axis).norm() < tolerance)
      add(std::string(scale).append(": ").append(force).append(" is zero at every pose"));
    else if (spread(axis) < tolerance)
      add(std::string(scale)
              .append(" cannot be told from U_0: ")
              .append(force)
              .append(" is the same at every pose"));
  }
  if (rank + named < 4) {
    const int open = 4 - rank - named;
    std::string words = std::to_string(open) + " combination" + (open > 1 ? "s" : "") +
                        " of K_x, K_y, K_z and U_0: ";
    words += design.rows() < 4 ? "there are only " + std::to_string(design.rows()) + " poses"
                               : "the specific force of all poses lies in one plane";
    add(words);
  }
  return text;
}

}  // namespace

Eigen::MatrixXd design_matrix(const std::vector<PoseMean>& poses, const Gravity& gravity) {
  const double gamma = gravity.local_mps2 / kStandardGravity_mps2;
  Eigen::MatrixXd design(static_cast<Eigen::Index>(poses.size()), 4);
  for (Eigen::Index row = 0; row < design.rows(); ++row) {
    const Pose& pose = poses[static_cast<std::size_t>(row)].pose;
    design.row(row) << specific_force(pose.delta_deg, pose.h_deg, gamma).a_g.transpose(), 1.0;
  }
  return design;
}

Observability observability(const Eigen::MatrixXd& design) {
  assert(design.rows() > 0 && design.cols() == 4);
  const Eigen::VectorXd singular_values = scaled_svd(design).singularValues();
  Observability result;
  result.rank = rank_of(singular_values);
  result.condition = result.rank == 4 ? singular_values(0) / singular_values(3)
                                      : std::numeric_limits<double>::infinity();
  if (result.rank < 4) result.unobservable = undetermined_directions(design, result.rank);
  return result;
}

std::optional<GeneralisedFit> fit_generalised(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                              const Eigen::MatrixXd& V) {
  assert(A.cols() == 4 && A.rows() == y.size() && V.rows() == y.size() && V.cols() == y.size());
  const std::optional<Whitening> whitening = Whitening::of(V);
  if (!whitening) return std::nullopt;

  GeneralisedFit fit;
  Eigen::MatrixXd observations(A.rows(), 5);
  observations << A, y;
  fit.whitened = whitening->apply(observations);
  const Eigen::MatrixXd whitened_A = fit.whitened.leftCols<4>();
  const LeastSquaresResult solution = solve_least_squares(whitened_A, fit.whitened.col(4));
  assert(solution.rank == 4);

  fit.estimate = {solution.x, solution.cofactor};
  fit.whitened_residual = solution.residual;
  fit.residual_V = y - A * solution.x;
  fit.gain = solution.cofactor * whitening->apply_transposed(whitened_A).transpose();
  fit.residual_covariance_V2 = V - A * solution.cofactor * A.transpose();
  return fit;
}

HeldoutResiduals heldout_residuals(const Eigen::MatrixXd& A, const Eigen::VectorXd& y,
                                   const Eigen::MatrixXd& V,
                                   const std::vector<std::vector<Eigen::Index>>& blocks) {
  const Eigen::Index n = A.rows();
  HeldoutResiduals heldout;
  heldout.residual_V = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  heldout.sd_V = heldout.residual_V;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(V);
  if (cholesky.info() != Eigen::Success) return heldout;

  // Z = V⁻¹ − V⁻¹·A·C·Aᵀ·V⁻¹; a block's free parameters are d = Z_BB⁻¹·(Z·y)_B, and the fit to the
  // rest is x − gain_B·d.
  const Eigen::MatrixXd V_inverse = inverse_from_factor(cholesky.matrixLLT());
  const std::optional<GeneralisedFit> fit = fit_generalised(A, y, V);
  if (!fit) return heldout;
  const Eigen::MatrixXd V_inverse_A = V_inverse * A;
  const Eigen::VectorXd Z_y = cholesky.solve(fit->residual_V);

  for (const std::vector<Eigen::Index>& block : blocks) {
    std::vector<Eigen::Index> rest;
    for (Eigen::Index row = 0, next = 0; row < n; ++row) {
      if (next < std::ssize(block) && block[static_cast<std::size_t>(next)] == row)
        ++next;
      else
        rest.push_back(row);
    }
    if (rest.size() < 4) continue;
    if (rank_of(scaled_svd(A(rest, Eigen::all)).singularValues()) < 4) continue;

    const Eigen::MatrixXd weighted = V_inverse_A(block, Eigen::all);
    const Eigen::MatrixXd Z_BB =
        V_inverse(block, block) - weighted * fit->estimate.covariance * weighted.transpose();
    const Eigen::MatrixXd A_B = A(block, Eigen::all), gain = fit->gain(Eigen::all, block);
    // x_{−B} = x − Q·(Z·y)_B
    const Eigen::MatrixXd Q = Z_BB.llt().solve(gain.transpose()).transpose();
    heldout.residual_V(block) = y(block) - A_B * (fit->estimate.value - Q * Z_y(block));
    // Its covariance: V − A·C·Aᵀ is that of the residuals, Z_BB that of (Z·y)_B, and between them
    // stands I − A·gain.
    const Eigen::MatrixXd own =
        Eigen::MatrixXd::Identity(std::ssize(block), std::ssize(block)) - A_B * gain;
    const Eigen::MatrixXd A_Q = A_B * Q;
    const Eigen::VectorXd variance_V2 =
        fit->residual_covariance_V2.diagonal()(block) + 2 * A_Q.cwiseProduct(own).rowwise().sum() +
        (A_B * (Q * gain.transpose())).cwiseProduct(A_B).rowwise().sum();
    heldout.sd_V(block) = variance_V2.cwiseMax(0).cwiseSqrt();
  }
  return heldout;
}

}  // namespace plumbline
