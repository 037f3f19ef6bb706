#include "estimator/error_figures.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "estimator/kinematics.h"

namespace plumbline {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

double input_referred_mps2_per_V(const AxisEstimate& estimate, std::size_t axis) {
  const auto i = static_cast<Eigen::Index>(axis);
  const double scale_V_per_g = estimate.value(i);
  // A scale factor within five of its uncertainties of zero is a dead axis, not a sensor.
  if (std::abs(scale_V_per_g) <= 5.0 * std::sqrt(estimate.covariance(i, i))) return kNan;
  return kStandardGravity_mps2 / scale_V_per_g;
}

double rms(const Eigen::VectorXd& values) {
  double sum = 0;
  int count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value * value;
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : kNan;
}

WorstError worst_of(const PerAxis<LeftOutErrors>& errors) {
  WorstError worst;
  for (const LeftOutErrors& of_axis : errors)
    for (Eigen::Index k = 0; k < of_axis.error_mps2.size(); ++k)
      if (std::abs(of_axis.error_mps2(k)) > worst.error_mps2)
        worst = {std::abs(of_axis.error_mps2(k)), of_axis.u_mps2(k)};
  return worst;
}

double max_abs(const Eigen::VectorXd& values) {
  double largest = kNan;
  for (const double value : values)
    if (std::isfinite(value) && !(std::abs(value) <= largest)) largest = std::abs(value);
  return largest;
}

Blocks time_blocks(const std::vector<PoseMean>& poses) {
  constexpr std::size_t kStretches = 10;
  Blocks blocks(kStretches);
  for (std::size_t row = 0; row < poses.size(); ++row)
    blocks[row * kStretches / poses.size()].push_back(static_cast<Eigen::Index>(row));
  std::erase_if(blocks, [](const auto& block) { return block.empty(); });
  return blocks;
}

Blocks position_blocks(const std::vector<PoseMean>& poses) {
  constexpr double kDeltaCell_deg = 60;
  constexpr double kTiltCell_deg = 30;
  std::map<std::pair<int, int>, std::vector<Eigen::Index>> cells;
  for (std::size_t row = 0; row < poses.size(); ++row) {
    const Pose& pose = poses[row].pose;
    const double turn_deg = pose.delta_deg - 360.0 * std::floor(pose.delta_deg / 360.0);
    const std::pair cell(static_cast<int>(std::floor(turn_deg / kDeltaCell_deg)),
                         static_cast<int>(std::floor(pose.h_deg / kTiltCell_deg)));
    cells[cell].push_back(static_cast<Eigen::Index>(row));
  }
  Blocks blocks;
  for (auto& [cell, rows] : cells) blocks.push_back(std::move(rows));
  return blocks;
}

double sample_rms_V(const MeasurementSet& set, const Eigen::VectorXd& predicted_V,
                    std::size_t axis) {
  assert(predicted_V.size() == std::ssize(set.poses));
  double sum = 0;
  double count = 0;
  for (std::size_t k = 0; k < set.poses.size(); ++k) {
    const Pose& pose = set.poses[k];
    for (std::size_t row = pose.first; row < pose.first + pose.count; ++row) {
      const double error = set.samples.u_V[axis][row] - predicted_V(static_cast<Eigen::Index>(k));
      sum += error * error;
    }
    count += static_cast<double>(pose.count);
  }
  return count > 0 ? std::sqrt(sum / count) : std::numeric_limits<double>::quiet_NaN();
}

double expected_mean_square_V2(const Eigen::MatrixXd& A, const Eigen::MatrixXd& gain,
                               const Eigen::MatrixXd& V) {
  assert(A.rows() == V.rows() && gain.cols() == V.rows() && V.cols() == V.rows());
  const Eigen::MatrixXd gain_V = gain * V;
  const double trace = V.trace() - 2.0 * gain_V.cwiseProduct(A.transpose()).sum() +
                       (A.transpose() * A).cwiseProduct(gain_V * gain.transpose()).sum();
  return std::max(trace, 0.0) / static_cast<double>(V.rows());
}

double scatter_of_rms_V(const Eigen::MatrixXd& S) {
  const double trace = S.trace();
  return trace > 0 ? S.norm() / std::sqrt(2 * trace * static_cast<double>(S.rows())) : 0;
}

}  // namespace plumbline
