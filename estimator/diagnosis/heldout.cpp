#include "estimator/diagnosis/heldout.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <limits>

#include "estimator/parallel_for.h"

namespace plumbline {

PerAxis<Eigen::VectorXd> heldout_residuals_V(const VisitLog& log,
                                             const PerAxis<Eigen::VectorXd>& mean_V,
                                             const PoseWhitening& whitening, const EnlargedFit& fit,
                                             const Blocks& blocks) {
  const Eigen::Index n = mean_V[0].size();
  const Eigen::Index p = fit.covariance.rows();
  const auto predicted = predict_means_V(log, fit.parameters);
  const Eigen::MatrixXd jacobian = prediction_jacobian(log, fit.parameters);
  PerAxis<Eigen::MatrixXd> inverse, weighted_jacobian;
  PerAxis<Eigen::VectorXd> residual, weighted_residual, heldout;
  parallel_for(kAxisCount, [&](std::size_t i) {
    const Eigen::MatrixXd half =
        whitening.lower[i].triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(n, n));
    inverse[i] = half.transpose() * half;
    residual[i] = mean_V[i] - predicted[i];
    weighted_residual[i] = inverse[i] * residual[i];
    weighted_jacobian[i] = inverse[i] * jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
    heldout[i] = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  });
  for (const std::vector<Eigen::Index>& block : blocks) {
    // A free parameter for every reading of the block is the same as leaving it out.
    const Eigen::Index size = std::ssize(block);
    Eigen::MatrixXd Z = Eigen::MatrixXd::Zero(3 * size, 3 * size);
    Eigen::MatrixXd weighted(3 * size, p);
    Eigen::VectorXd right(3 * size);
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::Index at = static_cast<Eigen::Index>(i) * size;
      Z.block(at, at, size, size) = inverse[i](block, block);
      weighted.middleRows(at, size) = weighted_jacobian[i](block, Eigen::all);
      right.segment(at, size) = weighted_residual[i](block);
    }
    Z -= weighted * fit.covariance * weighted.transpose();
    // A parameter that only this block determines (one pose's own error) leaves Z singular; it
    // then keeps its value.
    const Eigen::VectorXd scale = Z.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * Z * scale.asDiagonal();
    scaled.diagonal().array() += 1e-9;
    const Eigen::VectorXd d = scale.cwiseProduct(scaled.ldlt().solve(scale.cwiseProduct(right)));
    const Eigen::VectorXd shift = fit.covariance * (weighted.transpose() * d);
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::MatrixXd rows = jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
      heldout[i](block) = residual[i](block) + rows(block, Eigen::all) * shift;
    }
  }
  return heldout;
}

}  // namespace plumbline
