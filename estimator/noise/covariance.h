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
  double duration_s() const { return step_s * static_cast<double>(count); }
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
/// - flicker: (1/π)·ln(τ_c/|τ|), averaged over both windows in closed form, with τ_c twice
///   the span of all windows: the constant is the level over two such runs, not over this one
///   alone. Positive definite, since τ_c exceeds the span's logarithmic capacity (span/4);
/// - random walk: starts at zero one step before the first window; with walk_decay_per_s > 0 it is
///   a stationary first-order Gauss-Markov process, exp(−|τ|·decay)/(2·decay), averaged likewise;
/// - ramp: time from the middle of the span.
std::array<Eigen::MatrixXd, kTermCount> unit_covariances(const std::vector<SampleWindow>& windows,
                                                         double walk_decay_per_s);

/// Covariance of the window means of a first-order Gauss-Markov process with unit driving density
/// and the given inverse correlation time.
Eigen::MatrixXd bounded_walk(const std::vector<SampleWindow>& windows, double decay_per_s);

/// The same of the second-order process v̇₁ = v₂, v̇₂ = −√2ω₀v₂ − ω₀²v₁ + u with unit driving
/// density, ω₀ = bend_rad_per_s: 1/(2√2ω₀³)·e^(−bτ)(cos bτ + sin bτ), b = ω₀/√2. It hardly
/// changes within a window, and is taken in the middle of each.
Eigen::MatrixXd smooth_walk(const std::vector<SampleWindow>& windows, double bend_rad_per_s);

/// A disturbance of narrow band: a sine whose amplitude and phase wander.
struct NarrowBand {
  double f_hz = 0;
  double decay_per_s = 0;  ///< inverse of the time over which it forgets its phase
};

/// The same windows as if each began where the one before ends.
std::vector<SampleWindow> without_pauses(std::vector<SampleWindow> windows);

/// Share of a sine's amplitude that the mean of the window keeps; its sign is that of the sine in
/// the middle of the window.
double share_of_sine(const SampleWindow& window, double f_hz);

/// Covariance of the window means of exp(−|τ|·decay)·cos 2πfτ, which hardly forgets within one:
/// what a disturbance of unit variance leaves of itself there.
Eigen::MatrixXd narrow_band(const std::vector<SampleWindow>& windows, const NarrowBand& band);

/// Covariance of the window means under all identified terms, U², positive definite when white
/// noise or rounding is present.
Eigen::MatrixXd mean_covariance(const NoiseModel& model, const std::vector<SampleWindow>& windows);

/// What rounding to a multiple of `step` from `origin` adds on average to readings of `value` with
/// Gaussian noise `sigma`, and its derivative by the value:
/// (step/π)·Σ_k (−1)^k/k·sin(2πk(value − origin)/step)·exp(−2π²k²σ²/step²). The bias lies between
/// −step/2 and step/2; beyond one step of noise there is none.
struct RoundingBias {
  double bias = 0;
  double slope = 0;
};
RoundingBias rounding_bias(double value, double origin, double step, double sigma);

/// Variance that rounding leaves in the mean of many readings after its bias at the expected value
/// and the slope there have been allowed for, when the true value scatters about the expected one
/// by `slow` from mean to mean and by `sigma` within: rounding_variance() for slow scatter of more
/// than a step, nothing without any.
double rounding_variance_left(double step, double sigma, double slow);

/// Variance, over a uniformly distributed true value, of the offset that rounding to `step` leaves
/// in the mean of many readings with Gaussian noise `sigma`:
/// step²/(2π²)·Σ_k exp(−4π²k²σ²/step²)/k². It is step²/12 without noise and nothing beyond one
/// step (Widrow & Kollár, Quantization Noise, chapter on characteristic functions).
double rounding_variance(double step, double sigma);

}  // namespace plumbline
