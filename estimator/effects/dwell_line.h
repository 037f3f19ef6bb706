// A sine that runs through all dwells with one frequency and one phase, as mains pickup does.
#pragma once

#include <optional>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// amplitude·sin(2π·f·t + phase) in the readings, t on the clock of the run.
struct DwellLine {
  double f_hz = 0;  ///< at most half the sampling rate: what is faster is seen at its alias
  double amplitude_V = 0;
  double phase_rad = 0;  ///< 0 … 2π
};

/// The line of one axis that noise would not often show (once in 10⁵ sets), if there is one. Looked
/// for from 1.5 periods a dwell up to half the sampling rate: first by the power within the dwells,
/// whatever their phases, then at the strongest frequencies by the sum over all dwells with one
/// phase, which is judged against the power of those same dwells (Schuster's test), so that the
/// colour of the noise does not matter. Empty for dwells of few samples.
std::optional<DwellLine> line_through_dwells(const MeasurementSet& set, std::size_t axis);

}  // namespace plumbline
