#include "estimator/diagnosis/heldout.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {

Heldout::Heldout(const VisitLog& log, const PerAxis<Eigen::VectorXd>& mean_V,
                 const PoseWhitening& whitening)
    : log_(log), mean_V_(mean_V) {
  parallel_for(kAxisCount, [&](std::size_t i) {
    inverse_[i] = inverse_from_factor(whitening.lower(i));
    mean_V2_[i] = whitening.lower(i).rowwise().squaredNorm();
  });
}

namespace {

/// Places of the parameters that act linearly. Shapes keep their values when a block is left out:
/// one that only this block determines would run away along its tangent, which no response does.
std::vector<Eigen::Index> linear_parameters(const EnlargedFit& fit) {
  std::vector<Eigen::Index> linear;
  for (Eigen::Index row = 0; row < fit.parameters.first_free(0); ++row) linear.push_back(row);
  for (std::size_t e = 0; e < fit.parameters.effects.size(); ++e)
    for (const EstimatedParameter& parameter : estimated_of(fit.parameters, e))
      if (parameter.info.role != ParameterRole::shape) linear.push_back(parameter.row);
  return linear;
}

/// Covariance of some parameters when the others are known.
Eigen::MatrixXd conditional_covariance(const Eigen::MatrixXd& covariance,
                                       const std::vector<Eigen::Index>& kept) {
  if (std::ssize(kept) == covariance.rows()) return covariance;
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation =
      scale.cwiseInverse().asDiagonal() * covariance * scale.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd information =
      correlation.ldlt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
  const Eigen::MatrixXd of_kept = information(kept, kept);
  const Eigen::VectorXd kept_scale = scale(kept);
  return kept_scale.asDiagonal() *
         of_kept.ldlt().solve(Eigen::MatrixXd::Identity(std::ssize(kept), std::ssize(kept))) *
         kept_scale.asDiagonal();
}

}  // namespace

std::vector<LeftOut> Heldout::leave_out(const EnlargedFit& fit,
                                        const std::vector<Blocks>& partitions) const {
  const Eigen::Index n = mean_V_[0].size();
  std::vector<LeftOut> result(partitions.size());
  for (LeftOut& left_out : result) {
    left_out.residual_V.fill(
        Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN()));
    left_out.sd_V = left_out.residual_V;
    if (!fit.determined) left_out.power.fill(std::numeric_limits<double>::infinity());
  }
  if (!fit.determined) return result;
  const std::vector<Eigen::Index> linear = linear_parameters(fit);
  const Eigen::MatrixXd covariance = conditional_covariance(fit.covariance, linear);
  const Eigen::Index p = covariance.rows();
  // What nothing but the block determines would be divided by the little that rounding left of it.
  const Eigen::VectorXd largest_shift = 10 * covariance.diagonal().cwiseSqrt();
  const auto predicted = predict_means_V(log_, fit.parameters);
  const Eigen::MatrixXd jacobian = prediction_jacobian(log_, fit.parameters)(Eigen::all, linear);
  PerAxis<Eigen::MatrixXd> axis_jacobian, weighted_jacobian;
  PerAxis<Eigen::VectorXd> residual, weighted_residual;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    axis_jacobian[i] = jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
    residual[i] = mean_V_[i] - predicted[i];
    weighted_residual[i] = inverse_[i] * residual[i];
    weighted_jacobian[i] = inverse_[i] * axis_jacobian[i];
  }
  const auto without = [&](const std::vector<Eigen::Index>& block, LeftOut& left_out) {
    // A free parameter for every reading of the block is the same as leaving it out.
    const Eigen::Index size = std::ssize(block);
    Eigen::MatrixXd Z = Eigen::MatrixXd::Zero(3 * size, 3 * size);
    Eigen::MatrixXd weighted(3 * size, p);
    Eigen::VectorXd right(3 * size);
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::Index at = static_cast<Eigen::Index>(i) * size;
      Z.block(at, at, size, size) = inverse_[i](block, block);
      weighted.middleRows(at, size) = weighted_jacobian[i](block, Eigen::all);
      right.segment(at, size) = weighted_residual[i](block);
    }
    Z -= weighted * covariance * weighted.transpose();
    // A parameter that only this block determines (one pose's own error) leaves Z singular; it
    // then keeps its value.
    const Eigen::VectorXd scale = Z.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * Z * scale.asDiagonal();
    scaled.diagonal().array() += 1e-9;
    // The parameters shift by Q·(V⁻¹·residual)_B, as in heldout_residuals().
    const Eigen::MatrixXd gain = covariance * weighted.transpose();
    Eigen::MatrixXd Q =
        scaled.ldlt().solve(scale.asDiagonal() * gain.transpose()).transpose() * scale.asDiagonal();
    const Eigen::VectorXd shift = (Q * right).cwiseMax(-largest_shift).cwiseMin(largest_shift);
    Eigen::MatrixXd added = Q * gain.transpose();
    const Eigen::VectorXd within =
        largest_shift.cwiseQuotient(added.diagonal().cwiseMax(1e-300).cwiseSqrt()).cwiseMin(1);
    added = within.asDiagonal() * added * within.asDiagonal();
    Q = within.asDiagonal() * Q;
    PerAxis<double> power;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::MatrixXd J_B = axis_jacobian[i](block, Eigen::all);
      left_out.residual_V[i](block) = residual[i](block) + J_B * shift;
      Eigen::MatrixXd own = -J_B * gain;
      own.middleCols(static_cast<Eigen::Index>(i) * size, size).diagonal().array() += 1;
      const Eigen::VectorXd variance_V2 = mean_V2_[i](block) -
                                          (J_B * covariance).cwiseProduct(J_B).rowwise().sum() +
                                          2 * (J_B * Q).cwiseProduct(own).rowwise().sum() +
                                          (J_B * added).cwiseProduct(J_B).rowwise().sum();
      left_out.sd_V[i](block) = variance_V2.cwiseMax(0).cwiseSqrt();
      const Eigen::VectorXd seen =
          weighted_residual[i](block) + weighted_jacobian[i](block, Eigen::all) * shift;
      const Eigen::MatrixXd precision = inverse_[i](block, block);
      power[i] = seen.dot(precision.llt().solve(seen));
    }
    return power;
  };
  std::vector<std::pair<std::size_t, std::size_t>> work;  // partition and block
  for (std::size_t part = 0; part < partitions.size(); ++part)
    for (std::size_t b = 0; b < partitions[part].size(); ++b) work.emplace_back(part, b);
  std::vector<PerAxis<double>> power(work.size());
  parallel_for(work.size(), [&](std::size_t w) {
    const auto [part, b] = work[w];
    power[w] = without(partitions[part][b], result[part]);
  });
  for (std::size_t w = 0; w < work.size(); ++w)
    for (std::size_t i = 0; i < kAxisCount; ++i) result[work[w].first].power[i] += power[w][i];
  return result;
}

double share_removed(double without, double with, double expected) {
  return (without - with) / std::max({without - expected, without - with, 1e-12 * without});
}

double heldout_dwell_gain(const VisitLog& log, const Observations& observed,
                          const PoseWhitening& whitening, const EnlargedFit& fit, std::size_t k,
                          const std::vector<Blocks>& partitions) {
  const ActiveEffect& active = fit.parameters.effects[k];
  if (!active.effect->within_dwell()) return 0;
  const auto without_V = predict_dwells_V(log, without_effect(fit.parameters, k));
  const auto with_V = predict_dwells_V(log, fit.parameters);
  const std::vector<std::size_t> axes = axes_of(active);
  const Eigen::Index n = std::ssize(log.visits), contrasts = log.dwell_contrasts();
  Eigen::MatrixXd left(n, contrasts * std::ssize(axes)), response(left.rows(), left.cols());
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const std::size_t axis = axes[i];
    const auto weights = whitening.dwell_sd_V[axis].cwiseInverse().asDiagonal();
    const Eigen::Index first = static_cast<Eigen::Index>(i) * contrasts;
    left.middleCols(first, contrasts) = (observed.dwell_V[axis] - without_V[axis]) * weights;
    response.middleCols(first, contrasts) = (with_V[axis] - without_V[axis]) * weights;
  }
  const double all_seen = left.cwiseProduct(response).sum(), all = response.squaredNorm();
  double before = 0, after = 0;
  for (const Blocks& blocks : partitions) {
    for (const std::vector<Eigen::Index>& block : blocks) {
      const Eigen::MatrixXd here = left(block, Eigen::all);
      const Eigen::MatrixXd model = response(block, Eigen::all);
      const double others = all - model.squaredNorm();
      if (!(others > 0)) continue;
      const double size = (all_seen - here.cwiseProduct(model).sum()) / others;
      before += here.squaredNorm();
      after += (here - size * model).squaredNorm();
    }
  }
  const double expected = static_cast<double>(partitions.size()) * static_cast<double>(left.size());
  return share_removed(before, after, expected);
}

}  // namespace plumbline
