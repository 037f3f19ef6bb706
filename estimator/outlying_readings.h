// Single readings that stand far out of those about them: a disturbed frame, a loose contact. A
// mean that holds one is off by many standard deviations, and would be blamed on the head or the
// sensor.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// A reading that stands out, and the one beside it that is taken in its place.
struct OutlyingReading {
  std::size_t row = 0, like = 0;
};

/// The readings of an axis that stand out of their dwells: off the median by more than 8 standard
/// deviations of single readings (from the median deviation of all dwells or of this one, the
/// larger) and by more than 4 steps of the converter, their neighbours not. Nothing where it is the
/// converter (codes that prove a fault, jumps at one voltage), where it comes again and again so
/// long after arrival or before the head leaves, or where more than 2 % stand out: that is noise of
/// another kind. Dwells of fewer than 8 readings are left as they are.
std::vector<OutlyingReading> outlying_readings(const MeasurementSet& set, std::size_t axis,
                                               const std::optional<Adc>& adc);

/// The same of a record without poses, whose readings are compared with those next to them.
std::vector<OutlyingReading> outlying_readings(const std::vector<double>& record);

/// What comes in the place of outlying readings leaves the times and the codes as they are.
void replace(std::vector<double>& readings, const std::vector<OutlyingReading>& outlying);

/// Replaces them on all axes; how many on each.
PerAxis<std::size_t> replace_outlying(MeasurementSet& set, const std::optional<Adc>& adc);

}  // namespace plumbline
