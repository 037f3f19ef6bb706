// From a record to its noise: the one entry point to noise identification.
#pragma once

#include <cstddef>
#include <vector>

#include "estimator/measurement.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// Noise of an evenly sampled record at rest, `record` in any unit U, `rate_hz` > 0. The five terms
/// are fitted together (term_fit.h). A record that cannot tell (too short, constant, not finite)
/// gives source "none", adequate false and a remark, never numbers.
NoiseModel identify_noise(const std::vector<double>& record, double rate_hz);

/// Noise when there is no static record, channel `axis` of the run's samples: white noise from the
/// scatter within the poses. The slow terms are unknown here, zero with zero information; they are
/// left to the run itself (reml.h). Source "bursts at the poses", or "none" when no pose has two
/// samples.
NoiseModel identify_noise_from_bursts(const SampleTable& samples, const std::vector<Pose>& poses,
                                      std::size_t axis);

}  // namespace plumbline
