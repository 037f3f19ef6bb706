#include "estimator/effects/dwell_event.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "estimator/effects/visit_log.h"
#include "estimator/noise/chi_squared.h"

namespace plumbline {
namespace {

/// Number of samples that most dwells have.
std::size_t usual_length(const MeasurementSet& set) {
  std::map<std::size_t, int> dwells;
  for (const Pose& pose : set.poses) ++dwells[pose.count];
  return std::max_element(dwells.begin(), dwells.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

/// One reading or a few, or all from one on.
std::vector<DwellEvent> events(std::size_t samples) {
  std::vector<DwellEvent> all;
  for (const std::size_t width : {1U, 2U, 4U})
    for (std::size_t from = 0; from + width <= samples; ++from)
      all.push_back({from, from + width, false});
  for (std::size_t from = 1; from < samples; ++from) all.push_back({from, samples, true});
  return all;
}

}  // namespace

std::optional<DwellEvent> event_in_dwells(const MeasurementSet& set, std::size_t axis) {
  constexpr std::size_t kShortest = 8;
  constexpr double kFew = 10;
  constexpr double kByChance = 1e-8;
  const std::size_t length = usual_length(set);
  if (length < kShortest) return {};
  const auto n = static_cast<Eigen::Index>(length);
  const Eigen::MatrixXd slow = step_contrasts(length);
  const auto without_slow = [&](Eigen::VectorXd course) {
    course.array() -= course.mean();
    return Eigen::VectorXd(course - slow * (slow.transpose() * course));
  };
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n);
  double dwells = 0, square_V2 = 0;
  for (const Pose& pose : set.poses) {
    if (pose.count != length) continue;
    const Eigen::VectorXd off_V = without_slow(
        Eigen::Map<const Eigen::VectorXd>(set.samples.u_V[axis].data() + pose.first, n));
    mean += off_V;
    square_V2 += off_V.squaredNorm();
    ++dwells;
  }
  if (dwells < kFew) return {};
  mean /= dwells;
  const double scatter_V2 = square_V2 - dwells * mean.squaredNorm();
  const double dof = (dwells - 1) * static_cast<double>(n - 1 - slow.cols());
  const double variance_V2 = scatter_V2 / (dof * dwells);  // of a reading of the mean course
  if (!(variance_V2 > 0)) return {};
  const std::vector<DwellEvent> all = events(length);
  const DwellEvent* best = nullptr;
  double best_gain = 0;
  for (const DwellEvent& event : all) {
    Eigen::VectorXd shape(n);
    for (Eigen::Index m = 0; m < n; ++m)
      shape(m) = event.contains(static_cast<std::size_t>(m)) ? 1 : 0;
    constexpr double kSeen = 0.05;  // of its square; less of it is all but slow
    const Eigen::VectorXd seen = without_slow(shape);
    if (seen.squaredNorm() < kSeen * (shape.array() - shape.mean()).square().sum()) continue;
    const double product = seen.dot(mean);
    const double gain = product * product / (seen.squaredNorm() * variance_V2);
    if (gain <= best_gain) continue;
    best_gain = gain;
    best = &event;
  }
  const double looks = static_cast<double>(all.size());
  if (best == nullptr || looks * chi_squared_tail(best_gain, 1) > kByChance) return {};
  return *best;
}

}  // namespace plumbline
