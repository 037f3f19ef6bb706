// Between which values of its recorded columns a run took place, and what lies beyond.
#pragma once

#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Least and greatest reading of a recorded column (temp_C included), in its own unit.
struct ColumnRange {
  std::string column;
  double low = 0;
  double high = 0;
};

/// Of every column that was recorded; empty for no samples. Readings that are not finite do not
/// count.
std::vector<ColumnRange> column_ranges(const SampleTable& samples);

/// A column that was elsewhere than during the calibration, where nothing is known of the unit.
struct BeyondRange {
  ColumnRange calibrated;
  ColumnRange seen;
  std::size_t readings = 0;  ///< beyond the calibrated range
};

/// The columns of `samples` with readings outside `calibrated` by more than a tenth of its width;
/// columns that only one of both has are not compared.
std::vector<BeyondRange> beyond(const std::vector<ColumnRange>& calibrated,
                                const SampleTable& samples);

}  // namespace plumbline
