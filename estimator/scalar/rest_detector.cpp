#include "estimator/scalar/rest_detector.h"

#include <algorithm>
#include <cmath>

#include "estimator/effects/code_evidence.h"

namespace plumbline {
namespace {

/// Variance of one axis in the window about every sample; the windows of samples near the ends of
/// the record are cut short.
struct WindowVariance {
  std::vector<double> sum{0.0};     ///< of the first k readings about the first one
  std::vector<double> square{0.0};  ///< of their squares

  explicit WindowVariance(const std::vector<double>& u) {
    sum.reserve(u.size() + 1);
    square.reserve(u.size() + 1);
    for (const double value : u) {
      const double d = value - u.front();
      sum.push_back(sum.back() + d);
      square.push_back(square.back() + d * d);
    }
  }

  double over(std::size_t first, std::size_t end) const {
    const auto n = static_cast<double>(end - first);
    const double mean = (sum[end] - sum[first]) / n;
    return std::max(0.0, (square[end] - square[first]) / n - mean * mean);
  }
};

double quiet_variance(const WindowVariance& variance, const std::vector<double>& u,
                      std::size_t width) {
  constexpr double kQuantile = 0.2;
  std::vector<double> windows;
  for (std::size_t first = 0; first + width <= u.size(); first += width) {
    windows.push_back(variance.over(first, first + width));
  }
  const auto at = static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(windows.size() - 1));
  std::nth_element(windows.begin(), windows.begin() + at, windows.end());
  const double step = smallest_step(u);
  return std::max(windows[static_cast<std::size_t>(at)], step * step / 12);
}

}  // namespace

std::vector<Pose> find_rests(const SampleTable& samples, const RestOptions& options) {
  const std::size_t n = samples.size();
  if (n < 4) return {};
  const double step_s =
      (samples.t_s.back() - samples.t_s.front()) / static_cast<double>(samples.size() - 1);
  const std::size_t half =
      std::max<std::size_t>(1, static_cast<std::size_t>(options.window_s / step_s / 2));
  const std::size_t width = 2 * half + 1;
  if (width > n) return {};

  std::vector<bool> rests(n, true);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const std::vector<double>& u = samples.u_V[axis];
    const WindowVariance variance(u);
    const double limit = options.factor * quiet_variance(variance, u, width);
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t first = k < half ? 0 : k - half;
      if (variance.over(first, std::min(n, k + half + 1)) > limit) rests[k] = false;
    }
  }

  std::vector<Pose> found;
  for (std::size_t first = 0; first < n;) {
    if (!rests[first]) {
      ++first;
      continue;
    }
    // A gap in the record ends a rest: what happened meanwhile is not known.
    std::size_t end = first + 1;
    while (end < n && rests[end] && samples.t_s[end] - samples.t_s[end - 1] < options.window_s)
      ++end;
    if (samples.t_s[end - 1] - samples.t_s[first] >= options.shortest_s) {
      found.push_back({static_cast<long long>(found.size()), 0, 0, first, end - first});
    }
    first = end;
  }
  return found;
}

}  // namespace plumbline
