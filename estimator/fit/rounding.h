// Pose means freed of what a coarse converter adds to them.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimator/measurement.h"
#include "estimator/noise/noise_model.h"
#include "estimator/quantization/interval_fit.h"

namespace plumbline {

/// Standard deviation of what was rounded to `step_V` when the rounded readings scatter by
/// `recorded_V`.
double sd_before_rounding_V(double step_V, double recorded_V);

/// Whether noise of `sample_sd_V`, as recorded, is too small to average rounding to `step_V` away.
bool is_coarse_against(double step_V, double sample_sd_V);

/// The most that rounding to `step_V` takes from or adds to a mean of readings that scattered by
/// `sigma_V` before.
double largest_rounding_bias_V(double step_V, double sigma_V);

/// Readings of one axis with rounding, as a model sees it.
struct RoundingFree {
  Eigen::VectorXd mean_V;       ///< what the means would have been without rounding
  Eigen::VectorXd variance_V2;  ///< of each mean, white noise of its readings included; or zero
  /// Whether rounding matters. Then a static record, taken at one place within the step, does not
  /// say how large the white noise of other poses is.
  bool coarse = false;
  /// Where the steps keep their edges, most means say in which step the voltage lies and no more:
  /// errors are then stated of the means as measured. By how much their mean square exceeds that of
  /// variance_V2 (negative, if less); nothing where errors are those of mean_V.
  std::optional<double> beyond_V2 = {};
};

/// Noise that is small against the step of the converter does not average rounding away, but what
/// is left is a known function of the voltage (Widrow & Kollár, Quantization Noise). It is undone
/// to first order about `expected_V`, what a model expects of the means; near the middle of a step
/// a mean says little, and its variance grows. `sample_sd_V`: white noise of one reading as
/// recorded; `readings`: how many each mean is of. The scatter of the means about the expectation
/// says how well the place within the step is known; a model that lacks an effect gets no
/// correction and the whole variance of rounding. `line_V2`: what part of the square of sample_sd_V
/// is a line, which rounds steps off as noise does but does not add to the variance of a mean.
RoundingFree free_of_rounding(const Eigen::VectorXd& mean_V, const Eigen::VectorXd& expected_V,
                              const CodeScale& scale, double sample_sd_V,
                              const Eigen::VectorXd& readings, double line_V2 = 0);

/// What a static record says of the noise of other places when rounding matters: nothing of white
/// noise, which depends on the place within the step, and of slow noise only where the record's
/// own place lets it through. `sample_sd_V`: white noise of one reading as recorded.
NoiseModel record_beside_rounding(const NoiseModel& record, const Adc& adc, double sample_sd_V);

/// What each entry of correlated noise is expected to be given all the others, under `covariance`:
/// r_k − (Σ⁻¹r)_k/(Σ⁻¹)_kk. Added to a model's prediction it says where in the converter's step a
/// mean lies although the zero has drifted.
Eigen::VectorXd expected_from_others(const Eigen::MatrixXd& covariance,
                                     const Eigen::VectorXd& residual);

}  // namespace plumbline
