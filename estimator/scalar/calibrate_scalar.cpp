#include "estimator/scalar/calibrate_scalar.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "estimator/decision.h"
#include "estimator/noise/identify.h"
#include "estimator/scalar/head_check.h"
#include "estimator/scalar/scalar_fit.h"
#include "estimator/scalar/scalar_noise.h"
#include "estimator/scalar/scalar_search.h"
#include "estimator/scalar/scalar_verdict.h"

namespace plumbline {
namespace {

tl::unexpected<Error> refuse(const std::string& why) { return fail(ErrorCode::input, why); }

/// An axis whose mean never moves by more than its noise sees no gravity.
Result<void> check_axes(const std::vector<RestMean>& rests) {
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    double low = rests.front().reading(axis), high = low, inner = 0;
    for (const RestMean& rest : rests) {
      if (!rest.reading.allFinite()) return refuse("a reading is not a finite number");
      low = std::min(low, rest.reading(axis));
      high = std::max(high, rest.reading(axis));
      inner = std::max(inner, rest.covariance(axis, axis));
    }
    if (high - low > 10 * std::sqrt(inner) && high > low) continue;
    char text[200];
    std::snprintf(text, sizeof text,
                  "output %s does not follow the attitude: it moves by %.3g over %zu rests, its "
                  "noise is %.2g; is it connected, and were the attitudes different?",
                  kAxisName[i], high - low, rests.size(), std::sqrt(inner));
    return refuse(text);
  }
  return {};
}

std::string too_few(std::size_t rests) {
  return std::to_string(rests) + " interval" + (rests == 1 ? "" : "s") +
         " at rest cannot determine nine parameters; at least nine different attitudes are needed, "
         "better twenty or more";
}

ScalarEstimate estimate_of(const ScalarFit& fit, const Gravity& gravity) {
  ScalarEstimate estimate;
  estimate.value = fit.parameters.nine;
  estimate.covariance = fit.covariance.topLeftCorner<kScalarCount, kScalarCount>();
  // Gravity scales the three scales alike; the fit cannot see it.
  const double relative = gravity.u_mps2 / gravity.local_mps2;
  const Eigen::Vector3d scale = estimate.value.segment<3>(3);
  estimate.covariance.block<3, 3>(3, 3) += relative * relative * scale * scale.transpose();
  return estimate;
}

/// √(Σ w·r²/Σ w) with the squared share of gravity that the axis has.
double axis_rms(const Eigen::VectorXd& residual, const Eigen::VectorXd& share) {
  double sum = 0, weight = 0;
  for (Eigen::Index k = 0; k < residual.size(); ++k) {
    if (!std::isfinite(residual(k))) continue;
    sum += share(k) * residual(k) * residual(k);
    weight += share(k);
  }
  return weight > 0 ? std::sqrt(sum / weight) : 0;
}

double axis_max(const Eigen::VectorXd& residual, const Eigen::VectorXd& share) {
  double largest = 0;
  for (Eigen::Index k = 0; k < residual.size(); ++k) {
    if (std::isfinite(residual(k))) {
      largest = std::max(largest, std::sqrt(share(k)) * std::abs(residual(k)));
    }
  }
  return largest;
}

ErrorFigures figures_of(const ScalarFit& fit, const Eigen::MatrixXd& covariance,
                        const Eigen::MatrixXd& direction, const std::vector<RestMean>& rests) {
  Eigen::VectorXd both(2 * direction.rows());
  both << scalar_heldout_mps2(fit, covariance, scalar_time_blocks(rests.size())),
      scalar_heldout_mps2(fit, covariance, scalar_attitude_blocks(direction));
  const Eigen::Matrix3d M = scalar_matrix(fit.parameters.nine);
  Eigen::VectorXd sample(direction.rows());
  for (Eigen::Index k = 0; k < sample.size(); ++k) {
    const RestMean& rest = rests[static_cast<std::size_t>(k)];
    const Eigen::Vector3d seen = M.transpose() * direction.row(k).transpose();
    const double spread = 1 - 1 / static_cast<double>(rest.count);
    sample(k) = std::sqrt(fit.residual_mps2(k) * fit.residual_mps2(k) +
                          spread * seen.dot(rest.covariance * seen));
  }
  ErrorFigures figures;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const Eigen::VectorXd share = direction.col(static_cast<Eigen::Index>(i)).cwiseAbs2();
    figures.fit_pose_rms_mps2[i] = axis_rms(fit.residual_mps2, share);
    figures.heldout_pose_rms_mps2[i] = axis_rms(both, share.replicate(2, 1));
    figures.heldout_pose_max_abs_mps2[i] = axis_max(both, share.replicate(2, 1));
    figures.sample_rms_mps2[i] = axis_rms(sample, share);
  }
  return figures;
}

double residual_rms(const ScalarFit& fit) {
  const auto dof = static_cast<double>(fit.residual_mps2.size() - fit.jacobian.cols());
  return dof > 0 ? std::sqrt(fit.residual_mps2.squaredNorm() / dof) : 0;
}

}  // namespace

Eigen::Vector3d axis_cosines(const ScalarVector& nine) {
  // The reading is m = S⁻¹·T⁻¹·a + b: row i of T⁻¹ is the sensitive axis i.
  Eigen::Matrix3d T;
  T << 1, -nine(6), nine(7), 0, 1, -nine(8), 0, 0, 1;
  Eigen::Matrix3d axes = T.triangularView<Eigen::Upper>().solve(Eigen::Matrix3d::Identity());
  for (Eigen::Index i = 0; i < 3; ++i) axes.row(i).normalize();
  return {axes.row(0).dot(axes.row(1)), axes.row(0).dot(axes.row(2)), axes.row(1).dot(axes.row(2))};
}

Result<ScalarCalibration> calibrate_scalar(const ScalarInput& input,
                                           const CalibrationOptions& options) {
  constexpr double kWorstCondition = 1e3;
  const MeasurementSet& set = input.set;
  if (set.poses.size() < static_cast<std::size_t>(kScalarCount))
    return refuse(too_few(set.poses.size()));
  const std::vector<RestMean> rests = rest_means(set);
  if (auto good = check_axes(rests); !good) return fail(good.error());

  const double g_mps2 = input.description.gravity.local_mps2;
  ScalarData data{{}, g_mps2, make_visit_log(set, input.description)};
  for (const RestMean& rest : rests) data.reading.push_back(rest.reading);
  const auto start = ellipsoid_start(data.reading, g_mps2);
  if (!start) {
    return refuse("the readings of the " + std::to_string(rests.size()) +
                  " rests determine no ellipsoid: the attitudes are too few or too much alike; "
                  "turn every axis up, down and across");
  }
  const std::vector<SampleWindow> windows = pose_windows(set.samples, set.poses, 1e-3);
  InnerVariance inner = inner_variance(rests, *start);
  ScalarFit fit = fit_scalar(data, {*start, {}}, inner.blocks.asDiagonal());
  ScalarNoise noise;
  for (int pass = 0; pass < 2; ++pass) {
    inner = inner_variance(rests, fit.parameters.nine);
    noise = scalar_noise(inner.blocks, fit.residual_mps2, fit.jacobian,
                         scalar_directions(data, fit.parameters), windows);
    fit = fit_scalar(data, fit.parameters, noise.covariance);
  }
  if (!(fit.condition < kWorstCondition) || fit.covariance.size() == 0) {
    return refuse("the attitudes of the " + std::to_string(rests.size()) +
                  " rests do not determine: " + fit.weakest +
                  "; turn every axis up, down and "
                  "across");
  }

  ScalarCalibration result;
  result.intervals = rests.size();
  result.skipped_rows = set.skipped_rows;
  result.condition = fit.condition;
  result.estimate = estimate_of(fit, input.description.gravity);
  result.residual_rms_mps2 = residual_rms(fit);
  result.expected_rms_mps2 = std::sqrt(inner.white.mean());
  result.expected_rms_blocks_mps2 = std::sqrt(inner.blocks.mean());
  result.scatter_mps2 = noise.scatter_mps2;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    result.noise[i] = identify_noise_from_bursts(set.samples, set.poses, i);
  const Eigen::MatrixXd direction = scalar_directions(data, fit.parameters);
  result.before = figures_of(fit, noise.covariance, direction, rests);

  const CandidateList candidates = scalar_candidates(data.log);
  const ScalarSearchResult search =
      search_scalar(data, {rests, inner, windows}, fit, candidates, options.seed);
  const bool found = !search.findings.empty();
  const ScalarFit& final_fit = found ? search.fit : fit;
  const Eigen::MatrixXd& final_covariance = found ? search.noise.covariance : noise.covariance;
  result.final = estimate_of(final_fit, input.description.gravity);
  result.final_residual_rms_mps2 = residual_rms(final_fit);
  const Eigen::MatrixXd final_direction = scalar_directions(data, final_fit.parameters);
  result.after =
      found ? figures_of(final_fit, final_covariance, final_direction, rests) : result.before;
  decide_scalar_verdict({search, inner, data.log, noise.scatter_gain}, result);
  result.diagnosis.not_found =
      scalar_detection_limits(data, candidates, final_fit, final_covariance);

  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const Eigen::VectorXd share = direction.col(static_cast<Eigen::Index>(i)).cwiseAbs2();
    const double dof_share =
        1 - static_cast<double>(final_fit.jacobian.cols()) / static_cast<double>(rests.size());
    result.floor_pose_rms_mps2[i] =
        std::sqrt(share.dot(inner.blocks) / share.sum() * std::max(dof_share, 0.0));
    result.u_floor_pose_rms_mps2[i] =
        inner.blocks_dof > 0 ? result.floor_pose_rms_mps2[i] / std::sqrt(2 * inner.blocks_dof) : 0;
  }
  for (std::size_t k = 0; k < rests.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    result.samples += rests[k].count;
    result.rests.push_back({set.poses[k], rests[k].t_mean_s, rests[k].reading,
                            final_direction.row(row).transpose(), fit.residual_mps2(row),
                            final_fit.residual_mps2(row), std::sqrt(inner.blocks(row))});
  }
  if (input.description.limits) {
    const auto& errors = result.after.heldout_pose_max_abs_mps2;
    result.decision = decide(input.description.limits->max_abs_error_mps2,
                             *std::max_element(errors.begin(), errors.end()),
                             std::sqrt(final_covariance.diagonal().mean()));
  }
  if (set.has_angles) result.head = compare_with_head(input, result.final, noise.scatter_mps2);
  return result;
}

}  // namespace plumbline
