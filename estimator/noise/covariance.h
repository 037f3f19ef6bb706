// Covariance of window means (pose means) under the noise terms.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "estimator/noise/noise_model.h"

namespace plumbline {

/// `count` samples, the first at first_s, every step_s seconds.
struct SampleWindow {
  double first_s = 0;
  double step_s = 0;
  std::size_t count = 0;
};

/// The windows of the poses: first sample, median spacing, number. A pose of a single sample gets
/// the spacing of another pose, or `single_step_s` when all poses are single samples.
std::vector<SampleWindow> pose_windows(const SampleTable& samples, const std::vector<Pose>& poses,
                                       double single_step_s);

/// Covariance of the window means for each term with coefficient 1, n×n each, so that the whole is
/// Σ power_j · unit_j.
///
/// Windows must follow one another in time without overlap. Each sample is taken as the mean over
/// its own step (the convention of the Allan variance). The non-stationary terms need an origin,
/// which is only felt in the constant that every model here has as a free parameter:
/// - flicker: (1/π)·ln(τ_c/|τ|), averaged over both windows in closed form, with τ_c the span of
///   all windows. Positive definite, since τ_c exceeds the span's logarithmic capacity (span/4);
/// - random walk: starts at zero one step before the first window; with walk_decay_per_s > 0 it is
///   a stationary first-order Gauss-Markov process, exp(−|τ|·decay)/(2·decay), averaged likewise;
/// - ramp: time from the middle of the span.
std::array<Eigen::MatrixXd, kTermCount> unit_covariances(const std::vector<SampleWindow>& windows,
                                                         double walk_decay_per_s);

/// Covariance of the window means under all identified terms, U², positive definite when white
/// noise or rounding is present. Rounding coarser than the noise adds shared_rounding_variance() to
/// the diagonal.
Eigen::MatrixXd mean_covariance(const NoiseModel& model, const std::vector<SampleWindow>& windows);

/// Rounding offset that all readings of a window share under `model`, U²: rounding_variance() with
/// the noise before rounding, since the white noise of a record holds step²/12 of it. 0 without
/// `rounding_step`.
double shared_rounding_variance(const NoiseModel& model);

/// Variance, over a uniformly distributed true value, of the offset that rounding to `step` leaves
/// in the mean of many readings with Gaussian noise `sigma`:
/// step²/(2π²)·Σ_k exp(−4π²k²σ²/step²)/k². It is step²/12 without noise and nothing beyond one
/// step (Widrow & Kollár, Quantization Noise, chapter on characteristic functions).
double rounding_variance(double step, double sigma);

}  // namespace plumbline
