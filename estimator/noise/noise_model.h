// The identified noise of one channel: the five terms of IEEE Std 952, and the Allan curve they
// fit.
#pragma once

#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Coefficient of one noise term with its standard uncertainty.
struct NoiseTerm {
  double value = 0;
  double u = 0;
  bool present = false;    ///< distinguishable from zero on this record
  double upper_limit = 0;  ///< 95 % upper limit, meaningful when absent
};

/// A deviation curve with confidence limits; all vectors have the same length.
struct DeviationCurve {
  std::vector<double> tau_s;
  std::vector<long long> n;  ///< number of analysed differences
  std::vector<double> value;
  std::vector<double> lower;
  std::vector<double> upper;
};

/// Noise of one channel in units of the record ("U"; V for the outputs of a triad).
struct NoiseModel {
  NoiseTerm Q;  ///< quantization, U·s:             σ² = 3Q²/τ²
  NoiseTerm N;  ///< velocity random walk, U·√s:    σ² = N²/τ
  NoiseTerm B;  ///< bias instability, U:           σ² = 2B²ln2/π
  NoiseTerm K;  ///< acceleration random walk, U/√s: σ² = K²τ/3
  NoiseTerm R;  ///< ramp, U/s:                     σ² = R²τ²/2
  double rate_hz = 0;
  DeviationCurve oadev;        ///< overlapping Allan deviation of the record
  std::vector<double> fitted;  ///< Allan deviation of the fitted terms at oadev.tau_s
  double chi2 = 0;
  double dof = 0;
  double p_value = 1;
  bool adequate = false;  ///< the terms describe the record
  std::string source;     ///< "static record", "bursts at the poses" or "none"
};

}  // namespace plumbline
