#include "app/sequencer/settling.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace plumbline::app {

namespace {

/// Median of |x| of a standard normal variable, inverted: turns a median into a standard deviation.
constexpr double kMedianToSd = 1.4826;

/// Least-squares line through the values of one axis over a window.
struct Line {
  double slope_V_s = 0;
  double variance_V2 = 0;  ///< about the line, n − 2 degrees of freedom
};

/// Standard error of the slope of `n` equidistant samples for unit noise, 1/s.
double slope_error(std::size_t n, double rate_hz) {
  const auto count = static_cast<double>(n);
  return rate_hz * std::sqrt(12.0 / (count * (count * count - 1.0)));
}

template <class Iterator>
Line fit_line(Iterator first, Iterator last, std::size_t axis, const Adc& adc, double rate_hz) {
  const auto n = static_cast<double>(last - first);
  const double middle = (n - 1) / 2;
  double mean = 0;
  for (auto it = first; it != last; ++it) mean += adc.volts(it->code[axis]) / n;
  double sxy = 0;
  double syy = 0;
  double index = -middle;
  for (auto it = first; it != last; ++it, ++index) {
    const double deviation = adc.volts(it->code[axis]) - mean;
    sxy += index * deviation;
    syy += deviation * deviation;
  }
  const double sxx = n * (n * n - 1) / 12;
  return {sxy / sxx * rate_hz, std::max(0.0, syy - sxy * sxy / sxx) / (n - 2)};
}

bool consecutive(const RawSample& before, const RawSample& after) {
  return after.counter == before.counter + 1;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double shortest_settling_s(const SettlingOptions& options, double rate_hz) {
  return options.hold_s + options.window / rate_hz;
}

NoiseFloor white_noise_floor(double sd_V, const Adc& adc, std::size_t window, double rate_hz) {
  // A level between two codes makes the reading toggle: a standard deviation of half a step.
  const double sd = std::max(sd_V, adc.lsb_V() / 2);
  NoiseFloor floor;
  floor.sd_V.fill(sd);
  floor.slope_sd_V_s.fill(sd * slope_error(window, rate_hz));
  return floor;
}

std::optional<NoiseFloor> learn_noise_floor(const std::vector<RawSample>& soak, const Adc& adc,
                                            std::size_t window, double rate_hz) {
  PerAxis<std::vector<double>> variances;
  PerAxis<std::vector<double>> slopes;
  const auto length = static_cast<std::ptrdiff_t>(window);
  for (auto first = soak.begin(); soak.end() - first >= length; first += length) {
    const auto last = first + length;
    if (std::adjacent_find(first, last, [](const RawSample& a, const RawSample& b) {
          return !consecutive(a, b);
        }) != last)
      continue;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const Line line = fit_line(first, last, axis, adc, rate_hz);
      variances[axis].push_back(line.variance_V2);
      slopes[axis].push_back(std::abs(line.slope_V_s));
    }
  }
  if (slopes[0].empty()) return std::nullopt;
  NoiseFloor floor = white_noise_floor(0, adc, window, rate_hz);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    floor.sd_V[axis] = std::max(floor.sd_V[axis], std::sqrt(median(variances[axis])));
    floor.slope_sd_V_s[axis] =
        std::max(floor.slope_sd_V_s[axis], kMedianToSd * median(slopes[axis]));
  }
  return floor;
}

SettlingDetector::SettlingDetector(const SettlingOptions& options, const Adc& adc, double rate_hz,
                                   std::optional<NoiseFloor> floor)
    : options_(options), adc_(adc), rate_hz_(rate_hz), floor_(floor) {
  assert(options.window >= kSmallestWindow);
}

void SettlingDetector::restart() { samples_.clear(); }

bool SettlingDetector::add(const RawSample& sample) {
  if (!samples_.empty() && !consecutive(samples_.back(), sample)) samples_.clear();
  samples_.push_back(sample);
  const auto window = static_cast<std::size_t>(options_.window);
  if (samples_.size() > window) samples_.pop_front();
  if (samples_.size() < window) return false;
  const double largest_excess = 1 + options_.sigma_factor * std::sqrt(2.0 / (options_.window - 2));
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const Line line = fit_line(samples_.begin(), samples_.end(), axis, adc_, rate_hz_);
    const double slope_sd = floor_ ? floor_->slope_sd_V_s[axis]
                                   : std::max(std::sqrt(line.variance_V2), adc_.lsb_V() / 2) *
                                         slope_error(window, rate_hz_);
    if (std::abs(line.slope_V_s) > options_.sigma_factor * slope_sd) return false;
    if (floor_ && line.variance_V2 > floor_->sd_V[axis] * floor_->sd_V[axis] * largest_excess)
      return false;
  }
  return true;
}

}  // namespace plumbline::app
