// Statistics over many runs: control charts, process performance, comparison of two results.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace plumbline::app {

/// Chart of individuals and moving ranges (ISO 7870-2): limits mean ± 2.66 · mean moving range,
/// upper limit of the ranges 3.267 · mean moving range.
struct ControlChart {
  double mean = 0;
  double lower = 0;
  double upper = 0;
  double mean_range = 0;
  double upper_range = 0;
  std::vector<double> range;         ///< |x_i − x_{i−1}|, one fewer than values
  std::vector<std::size_t> outside;  ///< indices of the values beyond the limits
};
/// Nothing for fewer than 2 values.
std::optional<ControlChart> control_chart(const std::vector<double>& values);

struct Tolerance {
  std::optional<double> lower;
  std::optional<double> upper;
};
/// Process performance (ISO 22514-2) by the overall standard deviation s:
/// Pp = (U − L)/(6·s), Ppk = min((U − x̄)/(3·s), (x̄ − L)/(3·s)); Pp needs both limits.
struct Performance {
  double mean = 0;
  double s = 0;
  std::optional<double> Pp;
  std::optional<double> Ppk;
};
/// Nothing for fewer than 2 values. Without scatter there are no indices.
std::optional<Performance> performance(const std::vector<double>& values,
                                       const Tolerance& tolerance);

/// E_n = (a − b)/√(U_a² + U_b²) with U = 2·u; 0 when both are exact and equal.
double normalized_error(double a, double u_a, double b, double u_b);

}  // namespace plumbline::app
