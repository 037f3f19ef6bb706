#include "estimator/column_range.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/effects/visit_log.h"

namespace plumbline {

namespace {

const std::vector<double>* column_of(const SampleTable& samples, const std::string& name) {
  if (name == kTemperatureColumn) return samples.temp_C.empty() ? nullptr : &samples.temp_C;
  const auto column = std::find_if(samples.covariates.begin(), samples.covariates.end(),
                                   [&](const Covariate& c) { return c.name == name; });
  return column == samples.covariates.end() ? nullptr : &column->value;
}

ColumnRange range_of(const std::string& name, const std::vector<double>& values) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  ColumnRange range{name, kInfinite, -kInfinite};
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    range.low = std::min(range.low, value);
    range.high = std::max(range.high, value);
  }
  return range;
}

}  // namespace

std::vector<ColumnRange> column_ranges(const SampleTable& samples) {
  std::vector<std::string> names = {kTemperatureColumn};
  for (const Covariate& column : samples.covariates) names.push_back(column.name);
  std::vector<ColumnRange> ranges;
  for (const std::string& name : names) {
    const std::vector<double>* values = column_of(samples, name);
    if (values == nullptr) continue;
    const ColumnRange range = range_of(name, *values);
    if (range.low <= range.high) ranges.push_back(range);
  }
  return ranges;
}

std::vector<BeyondRange> beyond(const std::vector<ColumnRange>& calibrated,
                                const SampleTable& samples) {
  constexpr double kMargin = 0.1;  // of the width
  std::vector<BeyondRange> result;
  for (const ColumnRange& range : calibrated) {
    const std::vector<double>* values = column_of(samples, range.column);
    if (values == nullptr) continue;
    const double margin = kMargin * (range.high - range.low);
    const auto outside = std::count_if(values->begin(), values->end(), [&](double value) {
      return value < range.low - margin || value > range.high + margin;
    });
    if (outside > 0)
      result.push_back({range, range_of(range.column, *values), static_cast<std::size_t>(outside)});
  }
  return result;
}

}  // namespace plumbline
