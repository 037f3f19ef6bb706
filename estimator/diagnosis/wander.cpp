#include "estimator/diagnosis/wander.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "estimator/diagnosis/heldout.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

/// What the noise has to explain: n means less the model, its columns, the variance of their own.
struct Left {
  Eigen::VectorXd residual_V, own_V2;
  Eigen::MatrixXd design;
  Eigen::Index count() const { return residual_V.size(); }
};

Left half_of(const Left& whole, Eigen::Index first, Eigen::Index count) {
  return {whole.residual_V.segment(first, count), whole.own_V2.segment(first, count),
          orthonormal_basis(whole.design.middleRows(first, count))};
}

NoiseProcesses half_of(const NoiseProcesses& whole, Eigen::Index first, Eigen::Index count) {
  NoiseProcesses half = whole;
  half.unit.clear();
  for (const Eigen::MatrixXd& unit : whole.unit)
    half.unit.emplace_back(unit.block(first, first, count, count));
  return half;
}

/// Sum of squares that noise of these powers expects to be count() less the columns.
double whitened_square(const NoisePool& pool, const Eigen::VectorXd& power, const Left& left) {
  const Eigen::MatrixXd P = make_projector(pool.covariance(power), left.design).P;
  return left.residual_V.dot(P * left.residual_V);
}

/// Share of the excess in each half of the run that the noise of the other half explains.
double gain_of_other_half(const NoiseProcesses& processes, const NoiseModel& record,
                          const Contradiction& found, const Left& left) {
  const Eigen::Index middle = left.count() / 2;
  double without = 0, with = 0, expected = 0;
  for (const bool first : {true, false}) {
    const Eigen::Index here = first ? 0 : middle, there = first ? middle : 0;
    const Eigen::Index count = first ? middle : left.count() - middle;
    const NoiseProcesses of_half = half_of(processes, here, count);
    const NoiseProcesses of_other = half_of(processes, there, left.count() - count);
    const Left half = half_of(left, here, count),
               other = half_of(left, there, left.count() - count);
    const Eigen::VectorXd power = NoisePool(of_other, without_record(record), other.own_V2)
                                      .pool(other.residual_V, other.design, &found.power_of_run)
                                      .power;
    const NoisePool pool(of_half, record, half.own_V2);
    without += whitened_square(pool, found.power_of_record, half);
    with += whitened_square(pool, power, half);
    expected += static_cast<double>(count - half.design.cols());
  }
  return share_removed(without, with, expected);
}

std::optional<NoiseDriver> wander(const SearchInput& input, std::size_t axis,
                                  const Eigen::VectorXd& start, const Left& left) {
  constexpr double kClearP = 1e-6;
  constexpr double kLeastRatio = 1.5;  // of standard deviations
  const NoiseModel& record = input.noise[axis];
  const NoisePool pool(input.processes, record, left.own_V2);
  const auto each = pool.contradiction(pool.pool(left.residual_V, left.design, &start),
                                       left.residual_V, left.design);
  if (!each) return {};
  const double log_p = log_chi_squared_tail(std::max(0.0, each->deviance),
                                            static_cast<double>(input.processes.count()));
  NoiseDriver driver{axis, "t_s", "noise, wandering beyond the static record"};
  driver.at_random = true;
  driver.p_value = p_of_search(log_p, kAxisCount);
  driver.sigmas = sigmas_of(log_p);
  if (!(driver.p_value < kClearP)) return {};
  const auto left_by = [&](const Eigen::VectorXd& power) {
    const Eigen::MatrixXd V = pool.covariance(power);
    return V.trace() - left.design.cwiseProduct(V * left.design).sum();
  };
  driver.ratio = std::sqrt(left_by(each->power_of_run) / left_by(each->power_of_record));
  if (!(driver.ratio > kLeastRatio)) return {};
  driver.u_ratio = driver.ratio * std::log(driver.ratio) / std::sqrt(each->deviance);
  driver.heldout_gain = gain_of_other_half(input.processes, record, *each, left);
  if (!(driver.heldout_gain > 0)) return {};
  return driver;
}

}  // namespace

std::vector<NoiseDriver> wanders_beyond_record(const SearchInput& input,
                                               const SearchResult& found) {
  const auto n = std::ssize(input.log.visits);
  const PerAxis<Eigen::VectorXd> predicted_V = predict_means_V(input.log, found.fit.parameters);
  const Eigen::MatrixXd jacobian = prediction_jacobian(input.log, found.fit.parameters);
  PerAxis<std::optional<NoiseDriver>> of_axis;
  parallel_for(kAxisCount, [&](std::size_t axis) {
    if (found.coarse[axis] || input.log.codes[axis].any()) return;
    const auto block = jacobian.middleRows(static_cast<Eigen::Index>(axis) * n, n);
    of_axis[axis] = wander(input, axis, found.noise[axis].power,
                           {found.observed.mean_V[axis] - predicted_V[axis], found.own_V2[axis],
                            orthonormal_basis(block)});
  });
  std::vector<NoiseDriver> all;
  for (auto& found_there : of_axis)
    if (found_there) all.push_back(std::move(*found_there));
  return all;
}

}  // namespace plumbline
