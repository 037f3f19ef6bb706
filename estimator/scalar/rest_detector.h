// Cuts a continuous record of a triad that was turned by hand into the intervals at rest.
#pragma once

#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// The detector, as stated in the help of the program:
///
/// 1. The variance of each axis is taken in a window centred on every sample.
/// 2. The quiet variance of an axis is the 20 % quantile of the variances of windows side by side,
///    at least step²/12 of the readings' own resolution.
/// 3. A sample is at rest when no axis's variance exceeds `factor` times its quiet variance.
/// 4. A rest is an unbroken run of such samples that lasts at least `shortest_s`. Because the
///    window is centred, half a window on either side is at rest too and is not used: the reading
///    settles there.
struct RestOptions {
  double window_s = 1.0;
  double factor = 9.0;  ///< three times the quiet standard deviation
  double shortest_s = 1.0;
};

/// The rests as poses numbered from 0, in order of time, angles 0. Empty when nothing rests or the
/// record is shorter than a window. Precondition: t_s increases.
std::vector<Pose> find_rests(const SampleTable& samples, const RestOptions& options = {});

}  // namespace plumbline
