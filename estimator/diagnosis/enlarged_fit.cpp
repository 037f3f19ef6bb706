#include "estimator/diagnosis/enlarged_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

bool has_a_sign_to_keep(const ParameterInfo& info) {
  return info.role == ParameterRole::shape && !info.place;
}

constexpr double kLargestChange = 3, kLikelyChange = 2;  // of a sensitivity, as ratios

/// Of one axis, to its own direction: about what it was at the start, or what that of another axis
/// was. A drift in an order of visits that goes up ring by ring may have taken most of it at the
/// start, and the axes of a triad are alike as a rule.
bool is_about_the_size(const EnlargedParameters& parameters, const EnlargedParameters& start,
                       std::size_t axis, double most) {
  const auto own = [](const EnlargedParameters& of, std::size_t i) {
    return of.twelve[i](static_cast<Eigen::Index>(i));
  };
  const auto is_about = [&](double ratio) { return ratio > 1 / most && ratio < most; };
  const double size = own(parameters, axis);
  if (is_about(size / own(start, axis))) return true;
  for (std::size_t other = 0; other < kAxisCount; ++other)
    if (other != axis && is_about(std::abs(size / own(start, other)))) return true;
  return false;
}

/// Whether part of the response of an axis may be creep.
bool remembers(const EnlargedParameters& parameters, std::size_t axis) {
  return std::any_of(parameters.effects.begin(), parameters.effects.end(),
                     [&](const ActiveEffect& active) {
                       return active.effect->remembers() && active.axis == axis &&
                              active.effect->subject() == Subject::sensor;
                     });
}

// Time constants, widths and the like keep their sign, and sensitivities about their size.
bool makes_sense(const EnlargedParameters& trial, const EnlargedParameters& start) {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (!is_about_the_size(trial, start, axis, kLargestChange)) return false;
  for (std::size_t e = 0; e < trial.effects.size(); ++e)
    for (const EstimatedParameter& size : estimated_of(trial, e))
      if (has_a_sign_to_keep(size.info) && !(size.value * start.effects[e].p[size.place] > 0))
        return false;
  return true;
}

/// A time constant that the readings hardly determine must not hold up all others by running across
/// zero: it stops short of that.
void stop_short_of_zero(const EnlargedParameters& from, EnlargedParameters& trial) {
  constexpr double kLeastLeft = 0.1;
  for (std::size_t e = 0; e < trial.effects.size(); ++e) {
    for (const EstimatedParameter& size : estimated_of(trial, e)) {
      const double least = kLeastLeft * from.effects[e].p[size.place];
      if (has_a_sign_to_keep(size.info) && !(size.value / least > 1))
        trial.effects[e].p[size.place] = least;
    }
  }
}

/// Of the Jacobian, those that belong to shapes.
std::vector<Eigen::Index> columns_of_shapes(const EnlargedParameters& parameters) {
  std::vector<Eigen::Index> columns;
  for (std::size_t e = 0; e < parameters.effects.size(); ++e)
    for (const EstimatedParameter& parameter : estimated_of(parameters, e))
      if (parameter.info.role == ParameterRole::shape) columns.push_back(parameter.row);
  return columns;
}

/// Covariance of parameters from the columns of their whitened Jacobian.
Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& whitened_jacobian) {
  const auto in_use = whitened_jacobian.topRows(rows_in_use(whitened_jacobian));
  const Eigen::VectorXd norms = in_use.colwise().norm();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(in_use * norms.cwiseInverse().asDiagonal());
  const Eigen::MatrixXd r = qr.matrixQR().topRows(norms.size()).triangularView<Eigen::Upper>();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(r.rows(), r.cols());
  r.triangularView<Eigen::Upper>().solveInPlace(inverse);
  inverse = norms.cwiseInverse().asDiagonal() * inverse;
  return inverse * inverse.transpose();
}

/// Whether effects take the place of a sensitivity: next to nothing is known of it beside them. Of
/// a response that is creep for the most part little is known at rest; that is no fault of a fit.
bool leave_a_sensitivity_open(const EnlargedFit& fit) {
  constexpr double kUncertain = 0.05, kByEffects = 10;  // of the axis's own, as a ratio
  std::optional<Eigen::MatrixXd> alone;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (remembers(fit.parameters, axis)) continue;
    const auto own = static_cast<Eigen::Index>(axis);
    const double least_V_per_g = kUncertain * std::abs(fit.parameters.twelve[axis](own));
    for (std::size_t component = 0; component < kAxisCount; ++component) {
      const auto k = static_cast<Eigen::Index>(4 * axis + component);
      const double u_V_per_g = std::sqrt(fit.covariance(k, k));
      if (u_V_per_g < least_V_per_g) continue;
      if (!alone)
        alone = covariance_of(fit.whitened_jacobian.leftCols(fit.parameters.first_free(0)));
      if (u_V_per_g > kByEffects * std::sqrt((*alone)(k, k))) return true;
    }
  }
  return false;
}

/// Whether effects are large differences of each other: what each of them does, beside the 12
/// parameters, is many times what all of them do. On other poses such a difference is anything.
bool cancel_each_other(const EnlargedFit& fit) {
  constexpr double kMost = 20;
  const auto& effects = fit.parameters.effects;
  if (effects.size() < 2) return false;
  const Eigen::MatrixXd& jacobian = fit.whitened_jacobian;
  const Eigen::MatrixXd twelve = orthonormal_basis(jacobian.leftCols(fit.parameters.first_free(0)));
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(jacobian.rows());
  double largest = 0;
  for (std::size_t e = 0; e < effects.size(); ++e) {
    Eigen::VectorXd own = whitened_contribution(fit, e);
    own -= twelve * (twelve.transpose() * own);
    largest = std::max(largest, own.norm());
    sum += own;
  }
  return largest > kMost * sum.norm();
}

}  // namespace

bool keeps_sensitivities(const EnlargedParameters& parameters, const EnlargedParameters& start,
                         double most) {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (!remembers(parameters, axis) && !is_about_the_size(parameters, start, axis, most))
      return false;
  return true;
}

bool knows_sensitivity(const EnlargedFit& fit, const EnlargedParameters& start, std::size_t axis) {
  constexpr double kUncertain = 0.3;  // as a ratio
  const auto own = static_cast<Eigen::Index>(axis);
  const auto k = static_cast<Eigen::Index>(4 * axis) + own;
  const double size_V_per_g =
      std::max(std::abs(fit.parameters.twelve[axis](own)), std::abs(start.twelve[axis](own)));
  return std::sqrt(fit.covariance(k, k)) < kUncertain * size_V_per_g;
}

bool leaves_a_size_open(const EnlargedFit& fit, double most) {
  for (std::size_t e = 0; e < fit.parameters.effects.size(); ++e)
    for (const EstimatedParameter& size : estimated_of(fit.parameters, e))
      if (has_a_sign_to_keep(size.info) &&
          !(std::sqrt(fit.covariance(size.row, size.row)) < most * std::abs(size.value)))
        return true;
  return false;
}

Eigen::VectorXd whitened_contribution(const EnlargedFit& fit, std::size_t effect) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(fit.whitened_jacobian.rows());
  for (const EstimatedParameter& parameter : estimated_of(fit.parameters, effect))
    if (parameter.info.role == ParameterRole::amplitude)
      sum += parameter.value * fit.whitened_jacobian.col(parameter.row);
  return sum;
}

void PoseWhitening::set(std::size_t axis, const Eigen::MatrixXd& covariance_V2) {
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance_V2);
  Eigen::MatrixXd lower = cholesky.matrixL();
  // What is no covariance determines no fit.
  if (cholesky.info() != Eigen::Success)
    lower.setConstant(std::numeric_limits<double>::quiet_NaN());
  Eigen::MatrixXd inverse = inverse_of_triangle(lower);
  factor[axis] = std::make_shared<const Factor>(Factor{std::move(lower), std::move(inverse)});
}

void PoseWhitening::apply_to_means(std::size_t axis, Eigen::Ref<Eigen::MatrixXd> means_V) const {
  // What concerns later visits only is zero before them, and stays so.
  Eigen::Index first = 0;
  while (first < means_V.rows() && (means_V.row(first).array() == 0).all()) ++first;
  const Eigen::Index rest = means_V.rows() - first;
  if (rest == 0) return;  // OpenBLAS complains of empty products
  const auto triangle = inverse(axis).bottomRightCorner(rest, rest);
  // So do the columns of a Jacobian that belong to other axes.
  const auto is_seen = [&](Eigen::Index j) { return (means_V.col(j).array() != 0).any(); };
  for (Eigen::Index j = 0, end = 0; j < means_V.cols(); j = end) {
    end = j + 1;
    if (!is_seen(j)) continue;
    while (end < means_V.cols() && is_seen(end)) ++end;
    multiply_by_triangle(triangle, means_V.block(first, j, rest, end - j));
  }
}

Eigen::MatrixXd PoseWhitening::apply(const Eigen::MatrixXd& all) const {
  Eigen::MatrixXd whitened = all;
  const Eigen::Index n = lower(0).rows();
  constexpr auto kAxes = static_cast<Eigen::Index>(kAxisCount);
  std::optional<SerialScope> alone;  // one column is done before a thread has started
  if (all.cols() == 1) alone.emplace();
  parallel_for(kAxisCount, [&](std::size_t axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    apply_to_means(axis, whitened.middleRows(i * n, n));
    const Eigen::Index contrasts = all.rows() > kAxes * n ? dwell_sd_V[axis].size() : 0;
    for (Eigen::Index d = 0; d < contrasts; ++d)
      whitened.middleRows((kAxes + i * contrasts + d) * n, n) /= dwell_sd_V[axis](d);
  });
  return whitened;
}

namespace {

/// The whitened Jacobian with its columns brought to length 1.
struct Tangent {
  Eigen::VectorXd norms;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
};

/// Of a fit at its parameters, which gets its Jacobian; nothing where that does not determine them.
std::optional<Tangent> tangent_at(const VisitLog& log, const PoseWhitening& whitening,
                                  EnlargedFit& fit) {
  constexpr double kDetermined = 1e-5;  // above what differences leave of a column that is none
  fit.whitened_jacobian = whitening.apply(prediction_jacobian(log, fit.parameters));
  Eigen::VectorXd norms = fit.whitened_jacobian.colwise().norm();
  if (!(norms.minCoeff() > 0)) return {};
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(fit.whitened_jacobian *
                                                 norms.cwiseInverse().asDiagonal());
  const auto diagonal = qr.matrixR().diagonal().cwiseAbs();
  if (!(diagonal.minCoeff() > kDetermined * diagonal.maxCoeff())) return {};
  return Tangent{std::move(norms), std::move(qr)};
}

/// fit_enlarged() with the Jacobian of the rows that the model can move only.
EnlargedFit fit_moved_rows(const VisitLog& log, const Observations& observed,
                           const PoseWhitening& whitening, const EnlargedParameters& start,
                           const FitLimits& limits) {
  // The last digits of a model that is far from the readings tell nothing: it is only compared.
  constexpr double kLastDigits = 1e-6, kShareOfExcess = 1e-5;
  constexpr double kMostOfASize = 10;  // by its uncertainty it might be many times what it is
  constexpr double kStepsLikeIt = 20;  // that a fit may still take, in what the last one gained
  const Eigen::Index rows = moved_rows(log, start);
  const Eigen::VectorXd measured = stacked_V(observed);
  const auto whitened_residual = [&](const EnlargedParameters& parameters) -> Eigen::VectorXd {
    return whitening.apply(measured.head(rows) - predict_stacked_V(log, parameters).head(rows));
  };
  EnlargedFit fit;
  fit.parameters = start;
  fit.whitened_residual = whitening.apply(measured - predict_stacked_V(log, start));
  const double unmoved_chi2 = fit.whitened_residual.tail(measured.size() - rows).squaredNorm();
  fit.chi2 = fit.whitened_residual.squaredNorm();
  EnlargedParameters tangent_of = start;
  for (int iteration = 0; iteration < limits.most_iterations && !fit.converged; ++iteration) {
    const std::optional<Tangent> tangent = tangent_at(log, whitening, fit);
    fit.determined = tangent.has_value();
    if (!tangent) return fit;
    tangent_of = fit.parameters;
    const Eigen::VectorXd& norms = tangent->norms;
    const Eigen::VectorXd step = tangent->qr.solve(fit.whitened_residual.head(rows));
    bool improved = false, refused = false;
    double gained = 0;
    const auto try_step = [&](const Eigen::VectorXd& scaled_step, bool stopping_short) {
      EnlargedParameters trial = fit.parameters;
      trial.set_free_values(fit.parameters.free_values() + scaled_step.cwiseQuotient(norms));
      if (stopping_short) stop_short_of_zero(fit.parameters, trial);
      if (!makes_sense(trial, start)) {
        refused = true;
        return;
      }
      const Eigen::VectorXd residual = whitened_residual(trial);
      const double chi2 = residual.squaredNorm() + unmoved_chi2;
      if (!(chi2 <= fit.chi2 * (1 + 1e-12))) return;
      improved = true;
      gained = fit.chi2 - chi2;
      const double excess = std::max(0.0, chi2 - 2 * static_cast<double>(rows));
      fit.converged = gained < kLastDigits + kShareOfExcess * excess;
      fit.parameters = trial;
      fit.whitened_residual.head(rows) = residual;
      fit.chi2 = chi2;
    };
    const auto try_steps = [&](bool stopping_short) {
      double share = 1;
      for (int halving = 0; halving < 8 && !improved; ++halving, share /= 2)
        try_step(share * step, stopping_short);
    };
    try_steps(false);
    if (iteration > 0 && improved && fit.chi2 - kStepsLikeIt * gained > limits.chi2_of_interest) {
      fit.given_up = true;
      fit.determined = false;
      return fit;
    }
    if (!improved && refused) try_steps(true);
    if (!improved) {
      // Along what the readings hardly determine, the tangent leads nowhere: shorter there only
      // (Levenberg, Marquardt).
      const Eigen::MatrixXd scaled = fit.whitened_jacobian * norms.cwiseInverse().asDiagonal();
      const Eigen::MatrixXd normal = scaled.transpose() * scaled;
      const Eigen::VectorXd slope = scaled.transpose() * fit.whitened_residual.head(rows);
      for (double damping = 1e-6; damping <= 1 && !improved; damping *= 100) {
        Eigen::MatrixXd damped = normal;
        damped.diagonal().array() += damping;
        try_step(damped.ldlt().solve(slope), true);
      }
      // A shape that changes next to nothing where it is would go anywhere: it stays there.
      if (!improved) {
        Eigen::MatrixXd held = normal;
        Eigen::VectorXd slope_of_rest = slope;
        for (const Eigen::Index shape : columns_of_shapes(fit.parameters)) {
          held.row(shape).setZero();
          held.col(shape).setZero();
          held(shape, shape) = 1;
          slope_of_rest(shape) = 0;
        }
        try_step(held.ldlt().solve(slope_of_rest), false);
      }
    }
    if (!improved) fit.converged = true;  // no direction leads down any more
  }
  // A shape may have come to where it does nothing: an edge between two readings.
  if (shapes_differ(fit.parameters, tangent_of) && !tangent_at(log, whitening, fit)) {
    fit.determined = false;
    return fit;
  }
  fit.covariance = covariance_of(fit.whitened_jacobian);
  fit.determined = keeps_sensitivities(fit.parameters, start, kLikelyChange) &&
                   !cancel_each_other(fit) && !leave_a_sensitivity_open(fit) &&
                   !leaves_a_size_open(fit, kMostOfASize);
  return fit;
}

}  // namespace

EnlargedFit fit_enlarged(const VisitLog& log, const Observations& observed,
                         const PoseWhitening& whitening, const EnlargedParameters& start,
                         const FitLimits& limits) {
  EnlargedFit fit = fit_moved_rows(log, observed, whitening, start, limits);
  const Eigen::Index rows = fit.whitened_jacobian.rows();
  fit.whitened_jacobian.conservativeResize(stacked_rows(log), Eigen::NoChange);
  fit.whitened_jacobian.bottomRows(stacked_rows(log) - rows).setZero();
  return fit;
}

EnlargedFit fit_holding_shapes(const VisitLog& log, const Observations& observed,
                               const PoseWhitening& whitening, const EnlargedParameters& start,
                               std::size_t first_new, const FitLimits& limits) {
  EnlargedFit fit = fit_enlarged(log, observed, whitening, start, limits);
  if (fit.determined || fit.given_up) return fit;
  EnlargedParameters held = fit.parameters;
  for (std::size_t e = first_new; e < held.effects.size(); ++e)
    held.effects[e] = with_shapes_held(held.effects[e]);
  return fit_enlarged(log, observed, whitening, held, limits);
}

EnlargedFit fit_from_levels(const VisitLog& log, const Observations& observed,
                            const PoseWhitening& whitening, const EnlargedParameters& start) {
  constexpr int kLevels = 16;
  const std::size_t axis = start.effects.back().axis;
  EnlargedParameters without = start;
  without.effects.pop_back();
  const Eigen::VectorXd change =
      predict_means_V(log, start)[axis] - predict_means_V(log, without)[axis];
  const double swing_V = change.maxCoeff() - change.minCoeff();
  EnlargedFit best;
  best.determined = false;
  for (int level = -kLevels; level <= kLevels; ++level) {
    EnlargedParameters shifted = start;
    shifted.twelve[axis](3) += swing_V * level / kLevels;
    EnlargedFit with = fit_enlarged(log, observed, whitening, shifted);
    if (with.determined && (!best.determined || with.chi2 < best.chi2)) best = std::move(with);
  }
  return best;
}

}  // namespace plumbline
