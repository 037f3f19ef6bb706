// The joint filter against batch nonlinear least squares, written down here on its own.
#include "estimator/fit/joint_filter.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <random>
#include <vector>

#include "estimator/kinematics.h"

namespace plumbline {
namespace {

// Twelve parameters, then the base's roll, the tilt's index and the spindle's skew.
constexpr Eigen::Index kParameters = 15;
using Parameters = Eigen::Matrix<double, kParameters, 1>;
constexpr double kRadians = 3.14159265358979323846 / 180;
constexpr double kSd_V = 6e-5;

struct JointVisit {
  double t_s = 0;
  double delta_deg = 0;
  double h_deg = 0;
  PerAxis<double> mean_V{};
};

double predicted_V(const Parameters& p, const JointVisit& visit, std::size_t axis) {
  const Eigen::Vector3d a = specific_force_g(
      {kRadians * visit.delta_deg, kRadians * visit.h_deg + p(13), p(12), p(14)}, 1);
  const auto first = 4 * static_cast<Eigen::Index>(axis);
  return p.segment<3>(first).dot(a) + p(first + 3);
}

JointPrediction prediction(const std::vector<JointVisit>& visits, const Parameters& p) {
  const auto n = std::ssize(visits);
  JointPrediction result{Eigen::VectorXd(3 * n), Eigen::MatrixXd(3 * n, kParameters)};
  for (Eigen::Index row = 0; row < 3 * n; ++row) {
    const JointVisit& visit = visits[static_cast<std::size_t>(row % n)];
    const auto axis = static_cast<std::size_t>(row / n);
    result.value_V(row) = predicted_V(p, visit, axis);
    for (Eigen::Index i = 0; i < kParameters; ++i) {
      Parameters up = p, down = p;
      up(i) += 1e-6;
      down(i) -= 1e-6;
      result.slope(row, i) = (predicted_V(up, visit, axis) - predicted_V(down, visit, axis)) / 2e-6;
    }
  }
  return result;
}

JointEstimate run_filter(const std::vector<JointVisit>& visits, const PerAxis<NoiseModel>& noise,
                         const Parameters& start) {
  JointReadings readings;
  const auto n = std::ssize(visits);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    readings.mean_V[axis].resize(n);
    for (Eigen::Index k = 0; k < n; ++k)
      readings.mean_V[axis](k) = visits[static_cast<std::size_t>(k)].mean_V[axis];
    readings.variance_V2[axis] = Eigen::VectorXd::Constant(n, kSd_V * kSd_V);
    readings.dwell_V[axis].resize(n, 0);
  }
  for (const JointVisit& visit : visits) readings.t_s.push_back(visit.t_s);
  return run_joint_filter(readings, [&](const Eigen::VectorXd& p) { return prediction(visits, p); },
                          start, noise, {});
}

std::vector<JointVisit> measure(const Parameters& truth, double walk_V, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<JointVisit> visits;
  PerAxis<double> drift_V{};
  for (int h = 0; h <= 80; h += 20) {
    for (int delta = 0; delta < 360; delta += 20) {
      JointVisit visit;
      visit.t_s = 3.0 * static_cast<double>(visits.size());
      visit.delta_deg = delta;
      visit.h_deg = h;
      for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
        visit.mean_V[axis] =
            predicted_V(truth, visit, axis) + drift_V[axis] + kSd_V * normal(random);
        drift_V[axis] += walk_V * normal(random);
      }
      visits.push_back(visit);
    }
  }
  return visits;
}

Parameters some_truth(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Parameters truth;
  truth << 0.032002, -0.0017435, 7.4811e-5, -2.5865, 0.0022174, 0.031399, 0.00016485, -2.4363,
      -0.00033471, -0.0017407, -0.032812, -2.3423, 0, 0, 0;
  for (Eigen::Index i = 0; i < kParameters; ++i)
    truth(i) += (i >= 12 ? 0.005 : i % 4 < 3 ? 3e-4 : 0.03) * normal(random);
  return truth;
}

/// Gauss-Newton by QR, numerical derivatives, white noise.
struct Batch {
  Parameters value;
  Parameters u;
};

Batch batch_fit(const std::vector<JointVisit>& visits, Parameters p) {
  const auto rows = 3 * std::ssize(visits);
  Eigen::MatrixXd J(rows, kParameters);
  Eigen::VectorXd r(rows);
  Eigen::MatrixXd inverse;
  for (int round = 0; round < 4; ++round) {
    for (Eigen::Index row = 0; row < rows; ++row) {
      const JointVisit& visit = visits[static_cast<std::size_t>(row / 3)];
      const auto axis = static_cast<std::size_t>(row % 3);
      r(row) = (visit.mean_V[axis] - predicted_V(p, visit, axis)) / kSd_V;
      for (Eigen::Index i = 0; i < kParameters; ++i) {
        Parameters up = p, down = p;
        up(i) += 1e-6;
        down(i) -= 1e-6;
        J(row, i) = (predicted_V(up, visit, axis) - predicted_V(down, visit, axis)) / 2e-6 / kSd_V;
      }
    }
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(J);
    p += qr.solve(r);
    inverse = qr.solve(Eigen::MatrixXd::Identity(rows, rows));
  }
  return {p, inverse.rowwise().norm()};
}

TEST(JointFilter, AgreesWithBatchNonlinearLeastSquares) {
  constexpr int kRuns =
      25;  // a fit takes some milliseconds; 200 with --gtest_repeat and other seeds
  int within = 0;
  double largest = 0, nees = 0, nis = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Parameters truth = some_truth(100 + static_cast<std::uint64_t>(run));
    const auto visits = measure(truth, 0, static_cast<std::uint64_t>(run));
    const JointEstimate joint = run_filter(visits, {}, some_truth(7));
    EXPECT_TRUE(joint.converged);
    const Batch batch = batch_fit(visits, some_truth(7));
    for (Eigen::Index i = 0; i < kParameters; ++i) {
      const double u = std::sqrt(joint.covariance(i, i));
      EXPECT_NEAR(u, batch.u(i), 0.01 * batch.u(i));
      const double en = std::abs(joint.value(i) - batch.value(i)) / (2 * std::hypot(u, batch.u(i)));
      within += en <= 1 ? 1 : 0;
      largest = std::max(largest, en);
    }
    const Parameters error = joint.value - truth;
    nees += error.dot(joint.covariance.inverse() * error);
    nis += joint.mean_nis;
  }
  EXPECT_GE(within, 0.95 * kRuns * kParameters);
  EXPECT_LT(largest, 0.02);  // the same optimum
  EXPECT_NEAR(nees / kRuns, 15, 3.29 * std::sqrt(30.0 / kRuns));
  EXPECT_NEAR(nis / kRuns, 1, 0.06);
}

TEST(JointFilter, FollowsDriftsThatTheBatchTakesForSignal) {
  PerAxis<NoiseModel> noise;
  for (NoiseModel& axis : noise) axis.K = {1e-4 / std::sqrt(3.0), 0, true, 0};
  constexpr int kRuns = 30;
  double nees = 0, nis = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Parameters truth = some_truth(300 + static_cast<std::uint64_t>(run));
    const auto visits = measure(truth, 1e-4, 900 + static_cast<std::uint64_t>(run));
    const JointEstimate joint = run_filter(visits, noise, some_truth(7));
    const Parameters error = joint.value - truth;
    nees += error.dot(joint.covariance.inverse() * error);
    nis += joint.mean_nis;
  }
  EXPECT_NEAR(nees / kRuns, 15, 3.29 * std::sqrt(30.0 / kRuns));
  EXPECT_NEAR(nis / kRuns, 1, 0.06);
}

}  // namespace
}  // namespace plumbline
