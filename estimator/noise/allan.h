// Allan-type deviations of an evenly sampled record, with confidence limits.
//
// The record is a rate (an acceleration is to velocity what a fractional frequency is to phase).
// Definitions and limits: NIST SP 1065 (Riley, 2008), sections 5.2 and 5.4; degrees of freedom by
// noise type: Greenhall & Riley, Proc. 35th PTTI, 2003.
#pragma once

#include <cstddef>
#include <vector>

#include "estimator/noise/noise_model.h"

namespace plumbline {

enum class Deviation { adev, oadev, mdev, tdev, hdev, ohdev, totdev, htotdev };

/// How averaging factors are spread.
enum class TauSpacing {
  octave,  ///< 1, 2, 4 …
  log100,  ///< about 100 values, evenly in log τ
  all,     ///< every one
};

/// A record integrated once: phase[i] = T·Σ_{j<i} (y_j − mean y), one entry more than the record.
/// Removing the mean keeps the sum small (no digits lost) and changes none of the deviations.
std::vector<double> integrate_record(const std::vector<double>& record, double rate_hz);

/// One deviation of phase data at averaging factor m ≥ 1; `n` differences went into it, none (and
/// value 0) when the record is too short for m.
struct DeviationPoint {
  double value = 0;
  long long n = 0;
};
DeviationPoint deviation_at(Deviation kind, const std::vector<double>& phase, double rate_hz,
                            std::size_t m);

/// The same at several averaging factors; the overlapping Allan deviation in one pass over the
/// phase (difference_sums.h).
std::vector<DeviationPoint> deviations_at(Deviation kind, const std::vector<double>& phase,
                                          double rate_hz, const std::vector<std::size_t>& factors,
                                          bool all_cores = true);

/// Averaging factors of a curve of `rates` rate samples, in increasing order.
std::vector<std::size_t> averaging_factors(Deviation kind, std::size_t rates, TauSpacing spacing);

/// A whole curve from phase data, in increasing τ, with limits that hold with probability
/// `confidence` (two-sided, χ² with the edf of the noise type found at each τ). Stops where too few
/// differences are left: the largest m is N/4 for the difference variances, N/2 for totdev, N/3
/// for htotdev, with N the number of rate samples.
DeviationCurve deviation_curve(Deviation kind, const std::vector<double>& phase, double rate_hz,
                               TauSpacing spacing = TauSpacing::octave, double confidence = 0.683);

/// The five curves that `noise.json` reports.
struct DeviationSet {
  DeviationCurve adev;
  DeviationCurve oadev;
  DeviationCurve mdev;
  DeviationCurve hdev;
  DeviationCurve totdev;
};
DeviationSet all_deviations(const std::vector<double>& record, double rate_hz);

}  // namespace plumbline
