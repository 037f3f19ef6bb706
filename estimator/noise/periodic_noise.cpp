#include "estimator/noise/periodic_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "estimator/linear_algebra.h"
#include "estimator/noise/reml.h"
#include "estimator/noise/square.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

/// The line of the records that is strongest in a mean, in units of the white noise there, of those
/// that may wander; nothing where none matters.
std::optional<SpectralLine> strongest_line(
    const PerAxis<NoiseModel>& noise, const SampleWindow& window,
    const std::function<bool(std::size_t axis, const SpectralLine&)>& goes_on) {
  constexpr double kMatters = 0.1;  // of the variance
  std::optional<SpectralLine> strongest;
  double most = kMatters;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const double white = square(noise[axis].N.value) / window.duration_s();
    for (const SpectralLine& line : noise[axis].record.lines) {
      const double in_mean = 0.5 * square(line.amplitude * share_of_sine(window, line.f_hz));
      if (!(white > 0 && in_mean > most * white) || goes_on(axis, line)) continue;
      most = in_mean / white;
      strongest = line;
    }
  }
  return strongest;
}

/// It wanders, and may be found a little off the frequency at which the record saw it: bands side
/// by side.
std::vector<NarrowBand> bands_about(const SpectralLine& line,
                                    const std::vector<SampleWindow>& windows) {
  constexpr std::array<double, 5> kPlaces = {-2, -1, 0, 1, 2};
  const double span_s = windows.back().first_s - windows.front().first_s;
  const double apart_hz = std::max(0.5 * line.width_hz, 1 / span_s);
  std::vector<NarrowBand> bands;
  bands.reserve(kPlaces.size());
  for (const double place : kPlaces)
    bands.push_back({line.f_hz + place * apart_hz, std::numbers::pi * apart_hz});
  return bands;
}

/// −2 ln L of the means of all axes of which a record tells the noise.
double deviance_in(const FurtherNoise& further, const PerAxis<NoiseModel>& noise,
                   const std::vector<SampleWindow>& windows, const PerAxis<Eigen::VectorXd>& mean_V,
                   const Eigen::MatrixXd& design) {
  const NoiseProcesses processes = noise_processes(windows, further);
  PerAxis<double> deviance{};
  parallel_for(kAxisCount, [&](std::size_t axis) {
    if (noise[axis].N.value > 0)
      deviance[axis] = NoisePool(processes, noise[axis], {}).pool(mean_V[axis], design).deviance;
  });
  return deviance[0] + deviance[1] + deviance[2];
}

}  // namespace

std::vector<FurtherNoise> possible_noises(
    const PerAxis<NoiseModel>& noise, const std::vector<SampleWindow>& windows,
    const PerAxis<Eigen::VectorXd>& mean_V, const Eigen::MatrixXd& design,
    const std::function<bool(std::size_t axis, const SpectralLine&)>& goes_on) {
  const Eigen::MatrixXd columns = orthonormal_basis(design);
  const auto line = columns.rows() > columns.cols()
                        ? strongest_line(noise, windows[windows.size() / 2], goes_on)
                        : std::nullopt;
  if (!line) return {{}};
  const FurtherNoise throughout{.bands = bands_about(*line, windows)};
  const FurtherNoise pausing{.bands = bands_about(*line, without_pauses(windows)),
                             .bands_pause = true};
  const auto deviance = [&](const FurtherNoise& further) {
    return deviance_in(further, noise, windows, mean_V, columns);
  };
  const double of_throughout = deviance(throughout), of_pausing = deviance(pausing);
  const FurtherNoise& wandering = of_pausing < of_throughout ? pausing : throughout;
  if (std::min(of_pausing, of_throughout) < deviance({}) - kPriceOfFurtherNoise)
    return {wandering, {}};
  return {{}, wandering};
}

}  // namespace plumbline
