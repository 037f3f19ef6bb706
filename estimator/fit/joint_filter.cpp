#include "estimator/fit/joint_filter.h"

#include <cassert>
#include <cmath>
#include <numbers>

#include "estimator/fit/least_squares.h"
#include "estimator/kinematics.h"

namespace plumbline {
namespace {

using State = Eigen::Matrix<double, kJointStateCount, 1>;
using Covariance = Eigen::Matrix<double, kJointStateCount, kJointStateCount>;
using Eigen::Index;

constexpr double kRadians = std::numbers::pi / 180;

double squared(double value) { return value * value; }
double coefficient(const NoiseTerm& term) { return term.present ? term.value : 0.0; }

/// What the axes' drifts do between visits.
struct Drift {
  double flicker_variance = 0;
  double flicker_rate_per_s = 0;
  double walk_density = 0;
  double walk_decay_per_s = 0;
};

Drift drift_of(const NoiseModel& noise, const JointFilterOptions& options) {
  // Equal heights of the Allan plateau, as in EightStateFilter.
  constexpr double kGaussMarkovPeak = 0.6174;
  const double plateau_V =
      coefficient(noise.B) * std::sqrt(2 * std::numbers::ln2 / std::numbers::pi);
  return {squared(plateau_V / kGaussMarkovPeak), 1 / options.flicker_correlation_s,
          squared(coefficient(noise.K)), noise.walk_decay_per_s};
}

void predict(const PerAxis<Drift>& drifts, double dt_s, State& x, Covariance& P) {
  State factor = State::Ones();
  State enters = State::Zero();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const Drift& drift = drifts[axis];
    const Index at = kJointDrift + 2 * static_cast<Index>(axis);
    factor(at) = std::exp(-drift.flicker_rate_per_s * dt_s);
    enters(at) = -drift.flicker_variance * std::expm1(-2 * drift.flicker_rate_per_s * dt_s);
    factor(at + 1) = std::exp(-drift.walk_decay_per_s * dt_s);
    enters(at + 1) = drift.walk_density * (drift.walk_decay_per_s > 0
                                               ? -std::expm1(-2 * drift.walk_decay_per_s * dt_s) /
                                                     (2 * drift.walk_decay_per_s)
                                               : dt_s);
  }
  x = x.cwiseProduct(factor);
  P = factor.asDiagonal() * P * factor.asDiagonal();
  P.diagonal() += enters;
}

Eigen::Vector3d force_g(const JointVisit& visit, const Eigen::Vector3d& head_rad, double gamma) {
  return specific_force_g(
      {kRadians * visit.delta_deg, kRadians * visit.h_deg + head_rad(1), head_rad(0), head_rad(2)},
      gamma);
}

/// Specific force and its derivatives by the three errors of the head.
struct Force {
  Eigen::Vector3d a_g;
  Eigen::Matrix3d slope;
};

Force linearised(const JointVisit& visit, const Eigen::Vector3d& head_rad, double gamma) {
  constexpr double kStep_rad = 1e-5;
  Force force{force_g(visit, head_rad, gamma), {}};
  for (Index i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = kStep_rad * Eigen::Vector3d::Unit(i);
    force.slope.col(i) =
        (force_g(visit, head_rad + step, gamma) - force_g(visit, head_rad - step, gamma)) /
        (2 * kStep_rad);
  }
  return force;
}

/// Ordinary least squares of each axis with an ideal head: where the first pass is linearised.
State first_guess(const std::vector<JointVisit>& visits, double gamma) {
  State guess = State::Zero();
  const auto n = std::ssize(visits);
  Eigen::MatrixXd A(n, 4);
  Eigen::VectorXd y(n);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    for (Index k = 0; k < n; ++k) {
      const JointVisit& visit = visits[static_cast<std::size_t>(k)];
      A.row(k) << force_g(visit, Eigen::Vector3d::Zero(), gamma).transpose(), 1;
      y(k) = visit.mean_V[axis];
    }
    guess.segment<4>(4 * static_cast<Index>(axis)) = solve_least_squares(A, y).x;
  }
  return guess;
}

}  // namespace

JointEstimate run_joint_filter(const std::vector<JointVisit>& visits, double gamma,
                               const PerAxis<NoiseModel>& noise,
                               const JointFilterOptions& options) {
  assert(!visits.empty());
  PerAxis<Drift> drifts;
  State prior_variance = State::Constant(squared(options.parameter_sd));
  for (Index i = 0; i < 3; ++i)
    prior_variance(kJointRoll + i) = squared(options.head_sd_rad[static_cast<std::size_t>(i)]);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    drifts[axis] = drift_of(noise[axis], options);
    const Index at = kJointDrift + 2 * static_cast<Index>(axis);
    prior_variance(at) = drifts[axis].flicker_variance;
    prior_variance(at + 1) = drifts[axis].walk_decay_per_s > 0
                                 ? drifts[axis].walk_density / (2 * drifts[axis].walk_decay_per_s)
                                 : 0;
  }

  State about = first_guess(visits, gamma);
  JointEstimate result;
  for (int pass = 0; pass < options.most_passes && !result.converged; ++pass) {
    // Parameters are far from zero and their prior is wide: counted from where the pass is
    // linearised, they keep their digits.
    State x = State::Zero();
    x.head<kJointDrift>() = about.head<kJointDrift>();
    x.segment<3>(kJointRoll).setZero();
    Covariance P = prior_variance.asDiagonal();
    double t_s = visits.front().t_s;
    double nis = 0;
    long counted = 0;
    for (const JointVisit& visit : visits) {
      predict(drifts, visit.t_s - t_s, x, P);
      t_s = visit.t_s;
      const Eigen::Vector3d head_rad = about.segment<3>(kJointRoll);
      const Force force = linearised(visit, head_rad, gamma);
      for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
        const Index first = 4 * static_cast<Index>(axis);
        const Index drift = kJointDrift + 2 * static_cast<Index>(axis);
        const Eigen::Vector3d K = about.segment<3>(first);
        State h = State::Zero();
        h.segment<3>(first) = force.a_g;
        h(first + 3) = h(drift) = h(drift + 1) = 1;
        h.segment<3>(kJointRoll) = force.slope.transpose() * K;
        // K·a about the point of linearisation: K̄·a̅ + a̅·(K − K̄) + K̄·slope·(head − head̄).
        const double expected_V = h.dot(x) - h.segment<3>(kJointRoll).dot(head_rad);
        const State Ph = P * h;
        const double variance = h.dot(Ph) + visit.variance_V2[axis];
        const double innovation_V = visit.mean_V[axis] - expected_V;
        const State gain = Ph / variance;
        x += gain * innovation_V;
        P -= gain * Ph.transpose();
        const State w = P * h;
        P += (visit.variance_V2[axis] * gain - w) * gain.transpose();
        if (variance < 1e-3 * squared(options.parameter_sd)) {
          nis += squared(innovation_V) / variance;
          ++counted;
        }
      }
      P = (0.5 * (P + P.transpose())).eval();
    }
    const State moved = (x - about).cwiseAbs();
    constexpr double kMoved = 1e-3;
    result.converged = true;
    for (Index i = 0; i < kJointDrift; ++i)
      result.converged = result.converged && moved(i) <= kMoved * std::sqrt(P(i, i));
    about = x;
    result.value = x.head<kJointDrift>();
    result.covariance = P.topLeftCorner<kJointDrift, kJointDrift>();
    result.mean_nis = counted > 0 ? nis / static_cast<double>(counted) : 0;
  }
  return result;
}

}  // namespace plumbline
