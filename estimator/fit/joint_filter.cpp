#include "estimator/fit/joint_filter.h"

#include <cassert>
#include <cmath>
#include <optional>

#include "estimator/fit/eight_state_filter.h"
#include "estimator/noise/square.h"

namespace plumbline {
namespace {

using Eigen::Index;

constexpr Index kAxes = static_cast<Index>(kAxisCount);
constexpr Index kDriftStates =
    2 * kAxes;  ///< flicker and random walk of each axis, after the parameters

/// What an axis's drifts do between visits.
struct Drift {
  double flicker_variance = 0;
  double flicker_rate_per_s = 0;
  double walk_density = 0;
  double walk_decay_per_s = 0;
};

Drift drift_of(const NoiseModel& noise, const JointFilterOptions& options) {
  return {flicker_variance_V2(noise), 1 / options.flicker_correlation_s,
          square(noise.K.coefficient()), noise.walk_decay_per_s};
}

/// One pass: the parameters counted from where the readings are linearised, so that they keep their
/// digits, and the drifts.
class Pass {
 public:
  Pass(const PerAxis<Drift>& drifts, const Eigen::VectorXd& prior_sd) : drifts_(drifts) {
    parameters_ = prior_sd.size();
    x_ = Eigen::VectorXd::Zero(parameters_ + kDriftStates);
    Eigen::VectorXd variance(x_.size());
    variance.head(parameters_) = prior_sd.cwiseAbs2();
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const Drift& drift = drifts_[axis];
      variance(drift_at(axis)) = drift.flicker_variance;
      variance(drift_at(axis) + 1) =
          drift.walk_decay_per_s > 0 ? drift.walk_density / (2 * drift.walk_decay_per_s) : 0;
    }
    P_ = variance.asDiagonal();
  }

  void predict(double dt_s) {
    Eigen::VectorXd factor = Eigen::VectorXd::Ones(x_.size());
    Eigen::VectorXd enters = Eigen::VectorXd::Zero(x_.size());
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const Drift& drift = drifts_[axis];
      const Index at = drift_at(axis);
      factor(at) = std::exp(-drift.flicker_rate_per_s * dt_s);
      enters(at) = -drift.flicker_variance * std::expm1(-2 * drift.flicker_rate_per_s * dt_s);
      factor(at + 1) = std::exp(-drift.walk_decay_per_s * dt_s);
      enters(at + 1) = drift.walk_density * (drift.walk_decay_per_s > 0
                                                 ? -std::expm1(-2 * drift.walk_decay_per_s * dt_s) /
                                                       (2 * drift.walk_decay_per_s)
                                                 : dt_s);
    }
    x_ = x_.cwiseProduct(factor);
    P_ = factor.asDiagonal() * P_ * factor.asDiagonal();
    P_.diagonal() += enters;
  }

  /// One reading, less its prediction where it is linearised. `axis`: whose drifts it carries.
  void update(const Eigen::VectorXd& slope, std::optional<std::size_t> axis, double left_V,
              double variance_V2) {
    Eigen::VectorXd h = Eigen::VectorXd::Zero(x_.size());
    h.head(parameters_) = slope;
    if (axis) h(drift_at(*axis)) = h(drift_at(*axis) + 1) = 1;
    const Eigen::VectorXd Ph = P_ * h;
    const double variance = h.dot(Ph) + variance_V2;
    const double innovation_V = left_V - h.dot(x_);
    const Eigen::VectorXd gain = Ph / variance;
    // The prior dominates as long as the parameters are less certain than the reading.
    if (axis && slope.dot(Ph.head(parameters_)) < 0.5 * variance) {
      nis_ += square(innovation_V) / variance;
      ++counted_;
    }
    x_ += gain * innovation_V;
    P_ -= gain * Ph.transpose();
    const Eigen::VectorXd w = P_ * h;
    P_ += (variance_V2 * gain - w) * gain.transpose();
  }

  void symmetrise() { P_ = (0.5 * (P_ + P_.transpose())).eval(); }
  Eigen::VectorXd moved() const { return x_.head(parameters_); }
  Eigen::MatrixXd covariance() const { return P_.topLeftCorner(parameters_, parameters_); }
  double mean_nis() const { return counted_ > 0 ? nis_ / static_cast<double>(counted_) : 0; }

 private:
  Index drift_at(std::size_t axis) const { return parameters_ + 2 * static_cast<Index>(axis); }

  const PerAxis<Drift>& drifts_;
  Index parameters_ = 0;
  Eigen::VectorXd x_;
  Eigen::MatrixXd P_;
  double nis_ = 0;
  long counted_ = 0;
};

/// A hundred thousand times as wide as what all readings say of each parameter alone.
Eigen::VectorXd prior_sd(const JointReadings& readings, const Eigen::MatrixXd& slope) {
  constexpr double kWide = 1e5;
  const Index n = std::ssize(readings.t_s);
  Eigen::VectorXd information = Eigen::VectorXd::Zero(slope.cols());
  for (Index i = 0; i < kAxes; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    const Eigen::VectorXd weight = readings.variance_V2[axis].cwiseInverse();
    information += slope.middleRows(i * n, n).cwiseAbs2().transpose() * weight;
    const Eigen::VectorXd& sd_V = readings.dwell_sd_V[axis];
    for (Index d = 0; d < sd_V.size(); ++d)
      information += slope.middleRows((kAxes + i * sd_V.size() + d) * n, n)
                         .cwiseAbs2()
                         .colwise()
                         .sum()
                         .transpose() /
                     square(sd_V(d));
  }
  return kWide * information.cwiseSqrt().cwiseInverse();
}

}  // namespace

JointEstimate run_joint_filter(const JointReadings& readings, const JointModel& model,
                               const Eigen::VectorXd& start, const PerAxis<NoiseModel>& noise,
                               const JointFilterOptions& options) {
  assert(!readings.t_s.empty());
  PerAxis<Drift> drifts;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    drifts[axis] = drift_of(noise[axis], options);
  const Index n = std::ssize(readings.t_s);
  const Index contrasts = readings.dwell_sd_V[0].size();
  JointEstimate result;
  result.value = start;
  for (int pass = 0; pass < options.most_passes && !result.converged; ++pass) {
    const JointPrediction about = model(result.value);
    Pass filter(drifts, prior_sd(readings, about.slope));
    double t_s = readings.t_s.front();
    for (Index k = 0; k < n; ++k) {
      const double now_s = readings.t_s[static_cast<std::size_t>(k)];
      filter.predict(now_s - t_s);
      t_s = now_s;
      for (Index i = 0; i < kAxes; ++i) {
        const auto axis = static_cast<std::size_t>(i);
        const Index row = i * n + k;
        filter.update(about.slope.row(row), axis, readings.mean_V[axis](k) - about.value_V(row),
                      readings.variance_V2[axis](k));
        for (Index d = 0; d < contrasts; ++d) {
          const Index at = (kAxes + i * contrasts + d) * n + k;
          if (about.slope.row(at).isZero(0)) continue;  // says nothing about any parameter
          filter.update(about.slope.row(at), std::nullopt,
                        readings.dwell_V[axis](k, d) - about.value_V(at),
                        square(readings.dwell_sd_V[axis](d)));
        }
      }
      filter.symmetrise();
    }
    const Eigen::VectorXd moved = filter.moved();
    result.covariance = filter.covariance();
    constexpr double kMoved = 1e-3;
    result.converged =
        (moved.array().abs() <= kMoved * result.covariance.diagonal().array().sqrt()).all();
    result.value += moved;
    result.mean_nis = filter.mean_nis();
  }
  return result;
}

}  // namespace plumbline
