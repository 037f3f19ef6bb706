// The five noise terms fitted together to the cosine spectrum of a record.
#pragma once

#include <vector>

#include "estimator/noise/noise_model.h"
#include "estimator/noise/spectrum_sums.h"

namespace plumbline {

/// Restricted Gaussian likelihood of a spectrum at the powers [Q² N² B² K²], the ramp profiled out.
struct Likelihood {
  double deviance = 0;  ///< −2 ln L but for a constant
  /// Scoring step: the powers that solve normal·power = right are the next estimate, and normal/2
  /// is the Fisher information.
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
};
Likelihood spectrum_likelihood(const std::vector<SpectrumBin>& spectrum,
                               const Eigen::Vector4d& power);

/// Maximum (restricted) Whittle likelihood of Q, N, B, K ≥ 0 and the ramp.
struct TermFit {
  NoisePowers power = NoisePowers::Zero();                  ///< [Q² N² B² K² R²]
  double ramp_u = 0;                                        ///< standard uncertainty of the slope R
  NoisePowerMatrix information = NoisePowerMatrix::Zero();  ///< Fisher, about the powers; R zero
  /// Gain in 2·ln likelihood by having the term; for the ramp the squared slope over its variance.
  NoisePowers gain = NoisePowers::Zero();
  NoisePowers upper_power = NoisePowers::Zero();  ///< 95 % upper limits, of the squares
  double walk_decay_per_s = 0;  ///< of K; not 0 where the record shows that its walk is bounded
  double chi2 = 0;              ///< of the smoothed spectrum about the fit, one value a bin
  double dof = 0;
  bool converged = false;
  std::vector<SpectrumBin> spectrum;
  std::vector<SpectrumDescription> descriptions;  ///< see NoiseModel
};

/// Fits a spectrum of at least 8 bins (precondition). Spectral densities of the sampled terms,
/// two-sided, T = 1/rate, s = 2·sin(πfT):
///   Q: Q²s²/T,  N: N²,  B: B²T/s,  K: K²T²/s²,
/// the densities of IEEE Std 952 with aliasing: differenced, fractionally and once summed white
/// noise. A walk that is seen to level off is replaced by a first-order Gauss-Markov process, whose
/// correlation time is searched on a grid: carried on beyond the record it would grow without
/// bound. The ramp is a straight line, estimated by generalised least squares in the same fit;
/// the degree of freedom it takes is accounted for (restricted likelihood).
TermFit fit_terms(const SpectrumSums& sums);

}  // namespace plumbline
