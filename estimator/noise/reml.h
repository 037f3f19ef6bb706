// The noise powers of a run, learned from a static record and from the run's own residuals.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/noise/covariance.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// What is known of the noise of the run's window means.
struct PooledNoise {
  NoisePowers power = NoisePowers::Zero();                  ///< [Q² N² B² K² R²]
  /// Of both sources about the powers; filled by NoisePool::pooled_with_information() only.
  NoisePowerMatrix information = NoisePowerMatrix::Zero();
  double walk_decay_per_s = 0;  ///< of K: whether it is a walk or bounded
  Eigen::MatrixXd covariance;   ///< n×n of the window means with these powers
  double deviance = 0;          ///< −2 ln of the restricted likelihood but for a constant
  bool converged = false;
};

/// Restricted maximum likelihood (Patterson & Thompson, 1971) of the noise powers given window
/// means y = design·β + noise, β free, times the likelihood of the record that `model` came from.
/// Rounding stays as the model says. The ramp of the record is not carried on: over the run a slow
/// drift is told by the run itself, and flicker and random walk take it up. A record that
/// determines white noise well pins it; the slow terms, which a record shorter than the run barely
/// determines, move.
class NoisePool {
 public:
  /// mean: n; design: n×p of full rank, n > p; extra_variance: n further known variances
  /// (positioning, say), or empty. The arguments are copied but for `windows`.
  NoisePool(const NoiseModel& model, const std::vector<SampleWindow>& windows,
            const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
            const Eigen::VectorXd& extra_variance);

  /// Maximum over both sources.
  const PooledNoise& pooled() const { return pooled_; }
  /// The same with the information about the powers, which costs two products of n×n matrices.
  PooledNoise pooled_with_information() const;
  /// The model that was given, with the pooled coefficients.
  NoiseModel model() const;

  /// Σ of the window means at given powers.
  Eigen::MatrixXd covariance(const NoisePowers& power) const;

  /// ∂Σ/∂power, one n×n matrix a term.
  const std::array<Eigen::MatrixXd, kTermCount>& unit() const { return unit_; }

 private:
  struct Point;
  Point evaluate(const Eigen::Vector4d& power) const;
  Eigen::Matrix4d expected_information(const Eigen::Vector4d& power) const;
  Point maximise(const Eigen::Vector4d& start, unsigned free) const;
  PooledNoise pool() const;

  NoiseModel model_;
  std::array<Eigen::MatrixXd, kTermCount> unit_;
  Eigen::MatrixXd known_;  // ramp, rounding and extra variance
  Eigen::VectorXd mean_;
  Eigen::MatrixXd design_;
  NoisePowers start_;
  PooledNoise pooled_;
};

/// The pool with the walk, out of those that the record was described by, that describes record and
/// run best: what a short record takes for a random walk need not go on for the whole run.
NoisePool best_pool(const NoiseModel& model, const std::vector<SampleWindow>& windows,
                    const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                    const Eigen::VectorXd& extra_variance);

/// P = Σ⁻¹ − Σ⁻¹X(X'Σ⁻¹X)⁻¹X'Σ⁻¹, which whitens and removes the design at once: r'Σ⁻¹r = y'Py for
/// the generalised least-squares residual r.
struct Projector {
  Eigen::MatrixXd P;
  double log_determinant = 0;  ///< ln|Σ| + ln|X'Σ⁻¹X|
};
Projector make_projector(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& design);

}  // namespace plumbline
