// Samples that cannot be what the sensor put out.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/sequencer/engine_report.h"
#include "app/sequencer/settling.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// Why the samples of a pose must not be accepted, or nothing. Two things are looked for: a code at
/// an end of the converter's span (the output is beyond it), and an axis that gives one and the
/// same code although its noise is known to exceed the converter's step (a converter that hangs).
/// With less noise a constant code is what rounding does, and nothing is said.
std::optional<std::string> implausible(const std::vector<RawSample>& samples, const Adc& adc,
                                       const std::optional<NoiseFloor>& floor);

/// Means and scatter of a pose; `step` and the rest are taken over.
PoseMean mean_of(const storage::PoseRecord& pose, long long step, const Adc& adc);

/// In what the same position, measured twice, may differ: `tolerance` times the span of the known
/// means on that axis, six standard errors, and two converter steps. Nothing when it does not.
/// Returns what differs by how much, or nothing.
std::optional<std::string> disagreement(const PoseMean& before, const PoseMean& now,
                                        const PerAxis<double>& span_V, double tolerance,
                                        const Adc& adc);

}  // namespace plumbline::app
