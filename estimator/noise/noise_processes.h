// What the noise of a run consists of, as the means of its windows see it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/noise/covariance.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// The independent processes that the noise of a run is taken to consist of: quantization, white,
/// flicker and random walk of IEEE Std 952, then first-order Gauss-Markov processes (unit driving
/// density) whose correlation times go from a dwell to the whole run in equal ratios. What is seen
/// of real flicker, of several relaxations or of walks that level off, is a sum of these. Last, if
/// asked for, the ramp of Kostyuk & Lakoza (2012, eq. 6), a second-order process smoother than any
/// of them, with bends about the frequency of one turn in a run, and disturbances of narrow band.
/// What is smooth or periodic may as well be an effect: these are asked for only where a static
/// record shows as much.
struct NoiseProcesses {
  static constexpr Eigen::Index kFirstMarkov = 4;  ///< before it the order of NoiseTermIndex
  static constexpr Eigen::Index kFirstSlow = kTermB;
  static constexpr double kMarkovRatio = 4;  ///< of neighbouring correlation times
  std::vector<double> decay_per_s;           ///< of the Gauss-Markov processes, slowest first
  std::vector<double> bend_rad_per_s;        ///< of the smooth processes, slowest first
  std::vector<NarrowBand> bands;             ///< of the narrow-band ones, last of all
  std::vector<Eigen::MatrixXd> unit;         ///< covariance of the window means, power 1
  std::vector<bool> is_diagonal;             ///< of each: without memory between windows

  Eigen::Index count() const { return std::ssize(unit); }
  Eigen::Index first_smooth() const { return kFirstMarkov + std::ssize(decay_per_s); }
  Eigen::Index first_band() const { return first_smooth() + std::ssize(bend_rad_per_s); }
  /// Those that change over the run rather than from visit to visit.
  std::vector<Eigen::Index> walks() const;
  /// Variance of one window's mean by those of narrow band.
  double variance_of_bands(const Eigen::VectorXd& power, Eigen::Index window) const {
    double sum = 0;
    for (Eigen::Index i = first_band(); i < count(); ++i)
      sum += power(i) * unit[static_cast<std::size_t>(i)](window, window);
    return sum;
  }
  /// Mean variance about the mean of the run that a power of 1 of one of them makes.
  double variance_over_run(Eigen::Index process) const {
    const Eigen::MatrixXd& covariance = unit[static_cast<std::size_t>(process)];
    return covariance.diagonal().mean() - covariance.mean();
  }
};

/// By so much, of −2 ln L, must a run be likelier with further noise.
inline constexpr double kPriceOfFurtherNoise = 8;

/// What a run's noise holds beside what every noise may.
struct FurtherNoise {
  bool smooth = false;
  std::vector<NarrowBand> bands = {};
  /// The disturbance stands still between the windows, as where recorded noise is played back.
  bool bands_pause = false;
};
NoiseProcesses noise_processes(const std::vector<SampleWindow>& windows,
                               const FurtherNoise& further = {});

}  // namespace plumbline
