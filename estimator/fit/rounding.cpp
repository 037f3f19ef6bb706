#include "estimator/fit/rounding.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/linear_algebra.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/reml.h"
#include "estimator/quantization/interval_fit.h"

namespace plumbline {
namespace {

double mean_square(const Eigen::VectorXd& v) {
  return v.squaredNorm() / static_cast<double>(std::max<Eigen::Index>(v.size(), 1));
}

/// What is recorded holds the rounding itself: step²/12 when it is noise-like, less below. It grows
/// with the noise.
double noise_before_rounding_V2(double step_V, double recorded_V2) {
  constexpr int kHalvings = 30;
  double low_V = 0, high_V = std::sqrt(recorded_V2);
  for (int k = 0; k < kHalvings; ++k) {
    const double sigma_V = 0.5 * (low_V + high_V);
    const double would_record_V2 =
        sigma_V * sigma_V + step_V * step_V / 12 - rounding_variance(step_V, sigma_V);
    (would_record_V2 < recorded_V2 ? low_V : high_V) = sigma_V;
  }
  return 0.25 * (low_V + high_V) * (low_V + high_V);
}

/// Variance of one rounded reading of `value` (in steps from a code) with noise `sigma`, steps².
double rounded_variance(double value, double sigma) {
  const auto centre = std::round(value);
  const int reach = static_cast<int>(std::ceil(5 * sigma + 1));
  double mean = 0, square = 0;
  for (int code = -reach; code <= reach; ++code) {
    const double edge = centre + code - value;
    const double share =
        sigma > 0 ? normal_below((edge + 0.5) / sigma) - normal_below((edge - 0.5) / sigma)
                  : (code == 0 ? 1 : 0);
    mean += code * share;
    square += code * code * share;
  }
  return square - mean * mean;
}

/// The same on average when the value itself scatters by `slow` (Gauss-Hermite, three points).
double rounded_variance(double value, double sigma, double slow) {
  const double away = std::numbers::sqrt3 * slow;
  return 2.0 / 3 * rounded_variance(value, sigma) +
         (rounded_variance(value - away, sigma) + rounded_variance(value + away, sigma)) / 6;
}

/// Noise before rounding, in steps, of readings of these values (in steps from a code) that scatter
/// by `recorded` on average: poses that prefer a part of the step scatter more or less than all
/// parts together do. `uniform`: what it would be if they did not.
double sigma_at(const Eigen::ArrayXd& values, double recorded_variance, double uniform,
                double slow) {
  constexpr int kHalvings = 12;
  double low = 0.5 * uniform, high = 2 * uniform;
  for (int k = 0; k < kHalvings; ++k) {
    const double sigma = 0.5 * (low + high);
    double variance = 0;
    for (const double value : values) variance += rounded_variance(value, sigma, slow);
    (variance < recorded_variance * static_cast<double>(values.size()) ? low : high) = sigma;
  }
  return 0.5 * (low + high);
}

/// The readings of which these are the means, in steps from a code, of noise so small that they
/// share two neighbouring codes at most.
std::vector<CodeCounts> counts_of_means(const Eigen::VectorXd& mean,
                                        const Eigen::VectorXd& readings) {
  std::vector<CodeCounts> all;
  for (Eigen::Index k = 0; k < mean.size(); ++k) {
    CodeCounts codes;
    codes.mean = mean(k);
    // Whole readings: files round the voltages of the codes.
    const double sum = std::round(mean(k) * readings(k));
    const double lower = std::floor(sum / readings(k));
    const double above = sum - lower * readings(k);
    if (above < readings(k)) codes.count.emplace_back(lower, readings(k) - above);
    if (above > 0) codes.count.emplace_back(lower + 1, above);
    all.push_back(std::move(codes));
  }
  return all;
}

/// Of a step: with more noise 6e-5 of it are left of rounding to it.
constexpr double kNoTrace = 0.7;
/// Of a step: less noise leaves the staircase its edges; a mean says in which step the voltage lies
/// and no more, and to first order there is nothing to undo.
constexpr double kSoftest = 0.15;

/// Where steps keep their edges: the voltages from how many readings are on which side of them.
/// Noise of a reading in steps, as recorded and before rounding.
CodeSites within_edges(const Eigen::VectorXd& mean_V, const Eigen::VectorXd& expected_V,
                       const CodeScale& scale, const Eigen::VectorXd& readings, double recorded,
                       double uniform_sigma) {
  constexpr double kLeastSigma = 0.002;
  const Eigen::VectorXd mean = (mean_V.array() - scale.origin_V) / scale.step_V;
  const Eigen::VectorXd expected = (expected_V.array() - scale.origin_V) / scale.step_V;
  const double sigma = sigma_at(expected.array(), recorded * recorded, uniform_sigma, 0.0);
  return sites_about(expected, counts_of_means(mean, readings), std::max(sigma, kLeastSigma));
}

}  // namespace

double sd_before_rounding_V(double step_V, double recorded_V) {
  return std::sqrt(noise_before_rounding_V2(step_V, recorded_V * recorded_V));
}

double largest_rounding_bias_V(double step_V, double sigma_V) {
  constexpr int kPlaces = 32;
  double largest_V = 0;
  for (int k = 0; k < kPlaces; ++k)
    largest_V = std::max(largest_V, rounding_bias(step_V * k / kPlaces, 0, step_V, sigma_V).bias);
  return largest_V;
}

bool is_coarse_against(double step_V, double sample_sd_V) {
  return sd_before_rounding_V(step_V, sample_sd_V) <= kNoTrace * step_V;
}

NoiseModel record_beside_rounding(const NoiseModel& record, const Adc& adc, double sample_sd_V) {
  constexpr double kLeastSlope = 0.5;  // of the readings by the voltage, at the record's place
  constexpr int kHalvings = 30;
  const CodeScale scale = scale_of(adc);
  const double sigma_V = sd_before_rounding_V(scale.step_V, sample_sd_V);
  if (record.descriptions.empty() || sigma_V < kSoftest * scale.step_V)
    return without_record(record);
  const auto rounding = [&](double value_V) {
    return rounding_bias(value_V, scale.origin_V, scale.step_V, sigma_V);
  };
  double low_V = record.mean - 0.5 * scale.step_V, high_V = record.mean + 0.5 * scale.step_V;
  for (int k = 0; k < kHalvings; ++k) {
    const double middle_V = 0.5 * (low_V + high_V);
    (middle_V + rounding(middle_V).bias < record.mean ? low_V : high_V) = middle_V;
  }
  const double slope = 1 + rounding(low_V).slope;
  return slope < kLeastSlope ? without_record(record) : with_slow_noise_only(record, slope);
}

Eigen::VectorXd expected_from_others(const Eigen::MatrixXd& covariance,
                                     const Eigen::VectorXd& residual) {
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance);
  const Eigen::MatrixXd inverse = inverse_from_factor(cholesky.matrixLLT());
  return residual - (inverse * residual).cwiseQuotient(inverse.diagonal());
}

RoundingFree free_of_rounding(const Eigen::VectorXd& mean_V, const Eigen::VectorXd& expected_V,
                              const CodeScale& scale, double sample_sd_V,
                              const Eigen::VectorXd& readings, double line_V2) {
  constexpr double kLeastNoise = 0.01;  // of the square: how large a line is, is not known better
  const double step_V = scale.step_V, origin_V = scale.origin_V;
  const double recorded_V2 = sample_sd_V * sample_sd_V;
  const double noise_share = recorded_V2 > 0 ? std::max(1 - line_V2 / recorded_V2, kLeastNoise) : 1;
  double white_V2 = noise_before_rounding_V2(step_V, recorded_V2);
  double sigma_V = std::sqrt(white_V2);
  const Eigen::Index n = mean_V.size();
  if (sigma_V > kNoTrace * step_V) return {mean_V, Eigen::VectorXd::Zero(n), false};

  const double full_V2 = rounding_variance(step_V, sigma_V);
  const Eigen::VectorXd white_V2_of = noise_share * recorded_V2 * readings.cwiseInverse();
  const double mean_white_V2 = white_V2_of.mean();
  RoundingFree result{mean_V, (white_V2_of.array() + full_V2).matrix(), true};
  if (sigma_V < kSoftest * step_V) {
    const CodeSites sites =
        within_edges(mean_V, expected_V, scale, readings, sample_sd_V / step_V, sigma_V / step_V);
    result.mean_V = (origin_V + step_V * sites.mean.array()).matrix();
    result.variance_V2 = step_V * step_V * sites.variance;
    result.beyond_V2 = full_V2 + mean_white_V2 - result.variance_V2.mean();
    return result;
  }
  const double before_V2 = mean_square(mean_V - expected_V);
  // How far the true mean is from the expected one blurs the bias; found by repetition.
  double slow_V2 = std::max(0.0, before_V2 - full_V2 - mean_white_V2);
  sigma_V =
      step_V * sigma_at((expected_V.array() - origin_V) / step_V, recorded_V2 / (step_V * step_V),
                        sigma_V / step_V, std::sqrt(slow_V2) / step_V);
  white_V2 = sigma_V * sigma_V;
  const double most_V = largest_rounding_bias_V(step_V, sigma_V);
  for (int round = 0; round < 4; ++round) {
    // On the flats of the staircase undoing it to first order blows up what is not of first order.
    // Half the slope at least was worse: readings that are all alike passed for sure knowledge.
    constexpr double kFlattest = 0.1;
    RoundingFree trial{mean_V, Eigen::VectorXd::Zero(n), true};
    const double left_V2 = rounding_variance_left(step_V, sigma_V, std::sqrt(slow_V2));
    double raw_V2 = 0;
    double slow_sum_V2 = 0;
    for (Eigen::Index k = 0; k < n; ++k) {
      const RoundingBias bias =
          rounding_bias(expected_V(k), origin_V, step_V, std::sqrt(white_V2 + slow_V2));
      const double slope = std::max(1 + bias.slope, kFlattest);
      const double off_V = mean_V(k) - expected_V(k) - bias.bias;
      const double white_mean_V2 = noise_share * step_V * step_V / readings(k) *
                                   rounded_variance((expected_V(k) - origin_V) / step_V,
                                                    sigma_V / step_V, std::sqrt(slow_V2) / step_V);
      // Far from the expectation the slope there says nothing: rounding moves no mean further than
      // it moves any.
      const double reach_V = most_V + std::sqrt(white_mean_V2);
      trial.mean_V(k) =
          std::clamp(expected_V(k) + off_V / slope, mean_V(k) - reach_V, mean_V(k) + reach_V);
      trial.variance_V2(k) = (white_mean_V2 + left_V2) / (slope * slope);
      raw_V2 += off_V * off_V / static_cast<double>(n);
      slow_sum_V2 += (off_V * off_V - white_mean_V2 - left_V2) / static_cast<double>(n);
    }
    if (!(raw_V2 < before_V2)) break;
    result = std::move(trial);
    // The slope's mean square is 1 + that of the bias's slope.
    double slope_square = 1;
    for (int k = 1; k <= 20; ++k)
      slope_square += 2 * std::exp(-4 * std::numbers::pi * std::numbers::pi * k * k *
                                   (white_V2 + slow_V2) / (step_V * step_V));
    slow_V2 = std::max(0.0, slow_sum_V2 / slope_square);
  }
  return result;
}

}  // namespace plumbline
