#include "app/station/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace plumbline::app {

namespace {

/// 3/d2 and D4 for ranges of two values.
constexpr double kIndividuals = 2.66;
constexpr double kRanges = 3.267;

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

std::optional<ControlChart> control_chart(const std::vector<double>& values) {
  if (values.size() < 2) return std::nullopt;
  ControlChart chart;
  for (std::size_t i = 1; i < values.size(); ++i) {
    chart.range.push_back(std::abs(values[i] - values[i - 1]));
  }
  chart.mean = mean_of(values);
  chart.mean_range = mean_of(chart.range);
  chart.lower = chart.mean - kIndividuals * chart.mean_range;
  chart.upper = chart.mean + kIndividuals * chart.mean_range;
  chart.upper_range = kRanges * chart.mean_range;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] < chart.lower || values[i] > chart.upper) chart.outside.push_back(i);
  }
  return chart;
}

std::optional<Performance> performance(const std::vector<double>& values,
                                       const Tolerance& tolerance) {
  if (values.size() < 2) return std::nullopt;
  Performance found;
  found.mean = mean_of(values);
  double sum = 0;
  for (const double value : values) sum += (value - found.mean) * (value - found.mean);
  found.s = std::sqrt(sum / static_cast<double>(values.size() - 1));
  if (found.s <= 0) return found;
  if (tolerance.lower && tolerance.upper) {
    found.Pp = (*tolerance.upper - *tolerance.lower) / (6 * found.s);
  }
  double nearest = std::numeric_limits<double>::infinity();
  if (tolerance.upper) nearest = std::min(nearest, *tolerance.upper - found.mean);
  if (tolerance.lower) nearest = std::min(nearest, found.mean - *tolerance.lower);
  if (std::isfinite(nearest)) found.Ppk = nearest / (3 * found.s);
  return found;
}

double normalized_error(double a, double u_a, double b, double u_b) {
  const double U = 2 * std::hypot(u_a, u_b);
  if (U > 0) return (a - b) / U;
  return a == b ? 0 : std::copysign(std::numeric_limits<double>::infinity(), a - b);
}

}  // namespace plumbline::app
