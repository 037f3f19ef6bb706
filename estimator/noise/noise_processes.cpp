#include "estimator/noise/noise_processes.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <utility>

#include "estimator/median.h"

namespace plumbline {

namespace {

/// The same process with its course over the run counted from its mean, and the variance of that
/// mean added to all entries alike. Differences between windows are what they were, and so is all
/// that is estimated beside a free zero; but the zero becomes the level of the whole run instead of
/// the one at its ends, and its uncertainty still holds the wandering of that level.
Eigen::MatrixXd about_mean_of_run(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd with_mean = covariance.rowwise().mean();
  const double of_mean = with_mean.mean();
  Eigen::MatrixXd result = covariance;
  result.colwise() -= with_mean;
  result.rowwise() -= with_mean.transpose();
  result.array() += 2 * of_mean;
  return result;
}

}  // namespace

std::vector<Eigen::Index> NoiseProcesses::walks() const {
  constexpr Eigen::Index kSlowest = 2;  // Gauss-Markov processes
  std::vector<Eigen::Index> all = {kTermK};
  for (Eigen::Index m = 0; m < std::min(kSlowest, std::ssize(decay_per_s)); ++m)
    all.push_back(kFirstMarkov + m);
  for (Eigen::Index i = first_smooth(); i < first_band(); ++i) all.push_back(i);
  return all;
}

NoiseProcesses noise_processes(const std::vector<SampleWindow>& windows,
                               const FurtherNoise& further) {
  NoiseProcesses processes;
  auto terms = unit_covariances(windows, 0);
  for (std::size_t term = 0; term < static_cast<std::size_t>(NoiseProcesses::kFirstMarkov); ++term)
    processes.unit.push_back(term < kTermB ? std::move(terms[term])
                                           : about_mean_of_run(terms[term]));
  if (windows.empty()) return processes;
  const double span_s =
      windows.back().first_s + windows.back().duration_s() - windows.front().first_s;
  std::vector<double> dwell_s;
  dwell_s.reserve(windows.size());
  for (const SampleWindow& window : windows) dwell_s.push_back(window.duration_s());
  const double shortest_s = 0.5 * median(std::move(dwell_s));
  double tau_s = 0.7 * span_s;
  while (tau_s > shortest_s) {
    processes.decay_per_s.push_back(1 / tau_s);
    processes.unit.push_back(about_mean_of_run(bounded_walk(windows, 1 / tau_s)));
    tau_s /= NoiseProcesses::kMarkovRatio;
  }
  constexpr std::array<double, 3> kTurns = {0.5, 1.4, 4.0};  // in a run, at the bends
  for (std::size_t k = 0; further.smooth && k < kTurns.size(); ++k) {
    const double bend_rad_per_s = 2 * std::numbers::pi * kTurns[k] / span_s;
    processes.bend_rad_per_s.push_back(bend_rad_per_s);
    processes.unit.push_back(about_mean_of_run(smooth_walk(windows, bend_rad_per_s)));
  }
  const std::vector<SampleWindow> on_clock =
      further.bands_pause ? without_pauses(windows) : windows;
  for (const NarrowBand& band : further.bands) {
    processes.bands.push_back(band);
    processes.unit.push_back(narrow_band(on_clock, band));
  }
  for (const Eigen::MatrixXd& unit : processes.unit)
    processes.is_diagonal.push_back(unit.isDiagonal(0));
  return processes;
}

}  // namespace plumbline
