// Which terms a record's spectrum needs, and what the choice leaves open.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/spectrum_fit.h"
#include "estimator/noise/spectrum_sums.h"

namespace plumbline {

/// What −2·ln L must fall by for a term to be called present: a variance at the edge of its range
/// is ½χ²₀ + ½χ²₁ (Self & Liang, 1987), here at 2.5 %; the ramp χ²₁ at 1 %, since its variance is
/// itself an estimate.
inline constexpr double kVarianceGain = 3.84;
inline constexpr double kRampGain = 6.63;

/// A choice of terms and its fit.
struct TermDescription {
  SpectrumShape shape;
  bool quantization = false;  ///< Q may differ from zero
  Eigen::MatrixXd density;    ///< shape_densities()
  SpectrumFit fit;

  /// Of each bin, U².
  Eigen::VectorXd variance() const { return density.transpose() * fit.power; }
  /// Ramp, powers that are not zero, and parameters of the shape.
  double parameters() const;
  /// −2·ln L with what the additional terms must earn: the smaller the better.
  double score() const;
};

struct TermChoice {
  TermDescription chosen;
  TermDescription without_markov;  ///< the best one that has no Gauss-Markov term
  /// Squared uncertainty that the choice adds to the coefficients Q, N, B, K: their scatter over
  /// all descriptions tried, weighted by likelihood.
  Eigen::Vector4d spread = Eigen::Vector4d::Zero();
};

/// Starts from N, B and K (and Q where it is needed or `quantization` allows it at all) and adds
/// Gauss-Markov terms and limits of the flicker, each time the one that raises the likelihood most,
/// as long as it does so by more than chance.
TermChoice choose_terms(const SpectrumSums& sums, bool quantization);

}  // namespace plumbline
