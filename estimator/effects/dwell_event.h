// What happens in every dwell at the same time after arrival: a brake that releases, a conversion
// that disturbs one reading.
#pragma once

#include <cstddef>
#include <optional>

#include "estimator/measurement.h"

namespace plumbline {

/// From one sample of the dwell to before another.
struct DwellEvent {
  std::size_t from = 0;
  std::size_t to = 0;  ///< where it does not last
  bool lasts = false;  ///< to the end of the dwell, however long
  bool contains(std::size_t sample) const { return sample >= from && (lasts || sample < to); }
};

/// The likeliest of one axis, if noise would not show one as clear in one of 10⁸ sets: in the mean
/// course of all dwells of the usual length, beside what changes slowly there (step_contrasts()).
/// Nothing for dwells of few samples.
std::optional<DwellEvent> event_in_dwells(const MeasurementSet& set, std::size_t axis);

}  // namespace plumbline
