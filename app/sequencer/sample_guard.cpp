#include "app/sequencer/sample_guard.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace plumbline::app {

namespace {

/// A constant code is a fault when one sample's noise exceeds this many steps: with 0.9 steps the
/// most frequent code has a share of 42 %, and twelve in a row a probability of 3e−5.
constexpr double kNoiseSteps = 0.9;
constexpr std::size_t kConstantSamples = kSmallestWindow;
constexpr double kStandardErrors = 6;
constexpr double kSteps = 2;

}  // namespace

std::optional<std::string> implausible(const std::vector<RawSample>& samples, const Adc& adc,
                                       const std::optional<NoiseFloor>& floor) {
  const auto lowest = -(std::int32_t{1} << (adc.bits - 1));
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto at_end = [&](const RawSample& sample) {
      return sample.code[axis] <= lowest || sample.code[axis] >= -(lowest + 1);
    };
    if (std::any_of(samples.begin(), samples.end(), at_end)) {
      return fmt::format("output {} is at the end of the converter's span", kAxisName[axis]);
    }
    const auto same = [&](const RawSample& sample) {
      return sample.code[axis] == samples.front().code[axis];
    };
    if (floor && floor->sd_V[axis] > kNoiseSteps * adc.lsb_V() &&
        samples.size() >= kConstantSamples && std::all_of(samples.begin(), samples.end(), same)) {
      return fmt::format("output {} gives one code only, {}, and no noise: the converter hangs",
                         kAxisName[axis], samples.front().code[axis]);
    }
  }
  return std::nullopt;
}

PoseMean mean_of(const storage::PoseRecord& pose, long long step, const Adc& adc) {
  PoseMean mean;
  mean.step = step;
  mean.kind = pose.kind;
  mean.target = {pose.delta_deg, pose.h_deg};
  mean.settle_s = pose.settle_s;
  mean.samples = pose.samples.size();
  if (pose.samples.empty()) return mean;
  mean.t_s = pose.samples.front().t_s;
  const auto n = static_cast<double>(pose.samples.size());
  for (const RawSample& sample : pose.samples) {
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      mean.mean_V[axis] += adc.volts(sample.code[axis]) / n;
    }
    mean.temp_C += sample.temp_C / n;
  }
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    double square = 0;
    for (const RawSample& sample : pose.samples) {
      const double deviation = adc.volts(sample.code[axis]) - mean.mean_V[axis];
      square += deviation * deviation;
    }
    mean.sd_V[axis] = n > 1 ? std::sqrt(square / (n - 1)) : 0;
  }
  return mean;
}

std::optional<std::string> disagreement(const PoseMean& before, const PoseMean& now,
                                        const PerAxis<double>& span_V, double tolerance,
                                        const Adc& adc) {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const double variance = before.sd_V[axis] * before.sd_V[axis] /
                                static_cast<double>(std::max<std::size_t>(before.samples, 1)) +
                            now.sd_V[axis] * now.sd_V[axis] /
                                static_cast<double>(std::max<std::size_t>(now.samples, 1));
    const double allowed_V =
        tolerance * span_V[axis] + kStandardErrors * std::sqrt(variance) + kSteps * adc.lsb_V();
    const double difference_V = now.mean_V[axis] - before.mean_V[axis];
    if (std::abs(difference_V) <= allowed_V) continue;
    return fmt::format(
        "pose {} at δ = {:.2f}°, h = {:.2f}° gave {:.5f} V on {} and now gives {:.5f} V, {:.2g} mV "
        "apart where {:.2g} mV are allowed",
        before.step, before.target.delta_deg, before.target.h_deg, before.mean_V[axis],
        kAxisName[axis], now.mean_V[axis], 1e3 * std::abs(difference_V), 1e3 * allowed_V);
  }
  return std::nullopt;
}

}  // namespace plumbline::app
