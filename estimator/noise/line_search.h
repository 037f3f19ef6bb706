// Spectral lines: found, measured and taken out of a record, so that they do not pass for noise.
#pragma once

#include <vector>

#include "estimator/noise/noise_model.h"

namespace plumbline {

struct LineSearch {
  std::vector<SpectralLine> lines;  ///< strongest first
  std::vector<double> record;       ///< without them
  /// Cosine spectrum (spectrum.h) of `record`.
  std::vector<double> spectrum;
  /// Which of its coefficients the removal has touched, or that a line's skirts still fill; empty
  /// without lines.
  std::vector<bool> masked;
};

/// Searches a record of at least 64 finite samples (precondition).
///
/// The periodogram is divided by a smooth density (the fitted noise terms, then the running median
/// of the ratio), and an ordinate is a line when the chance that noise alone reaches it anywhere in
/// the spectrum is below 1e-3: exponential ordinates, the level known from m neighbours, so that
/// the tail is (1 + x/m)^−m (an F distribution; Fisher's test with a local level). The strongest
/// are subtracted with the frequency that fits them best, and the rest is searched again, until
/// nothing is left. Lines with fewer than 8 periods in the record are not told from slow noise.
LineSearch find_lines(const std::vector<double>& record, double rate_hz);

}  // namespace plumbline
