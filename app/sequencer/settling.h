// When has the output come to rest after a move? Judged by the samples alone, on the sensor's
// clock.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

/// Fewer samples show neither rest nor a converter that hangs.
inline constexpr int kSmallestWindow = 12;

/// [settling] of rig.toml. A pose is accepted once the head has been in position for `hold_s` and,
/// over a window of the latest samples, slope and scatter lie within what the noise leaves; or at
/// the hard cap. All times are those of the sensor's clock.
struct SettlingOptions {
  double hold_s = 0.1;        ///< "in position" without interruption, before anything is judged
  int window = 20;            ///< samples judged together, at least kSmallestWindow
  double sigma_factor = 4.0;  ///< how many standard errors slope and variance may lie off
  double cap_s = 10.0;        ///< accepted at the latest then, and recorded as capped
  /// Standard deviation of one sample at rest, for all axes; 0: learnt from the soak.
  double noise_V = 0;
  double angle_tolerance_deg = 0.01;  ///< of the encoder readings against the commanded angles
};

/// From arrival to the first sample when nothing has to be waited for.
double shortest_settling_s(const SettlingOptions& options, double rate_hz);

/// What windows of a unit at rest look like.
struct NoiseFloor {
  PerAxis<double> sd_V{};          ///< about the window's own line
  PerAxis<double> slope_sd_V_s{};  ///< of the window's slope; more than sd_V says when the noise is
                                   ///< coloured
};

/// White noise of `sd_V` on every axis: the slope's standard error is sd·sqrt(12/(n(n²−1)))·rate.
/// Neither goes below what rounding to the converter's step alone can do.
NoiseFloor white_noise_floor(double sd_V, const Adc& adc, std::size_t window, double rate_hz);

/// Medians over the windows of a record at rest, so that single disturbances do not count. Windows
/// across a gap of the counter are left out; empty when no whole window remains.
std::optional<NoiseFloor> learn_noise_floor(const std::vector<RawSample>& soak, const Adc& adc,
                                            std::size_t window, double rate_hz);

/// Slides a window over the samples that follow an arrival. Without a floor the slope is judged by
/// the window's own scatter, and the scatter not at all.
class SettlingDetector {
 public:
  SettlingDetector(const SettlingOptions& options, const Adc& adc, double rate_hz,
                   std::optional<NoiseFloor> floor);

  /// Forgets everything: a new arrival.
  void restart();
  /// Takes the next sample; a gap of the counter starts the window anew. True when the window is
  /// full and at rest.
  bool add(const RawSample& sample);
  /// The samples that were judged last.
  std::vector<RawSample> window() const { return {samples_.begin(), samples_.end()}; }

 private:
  SettlingOptions options_;
  Adc adc_;
  double rate_hz_;
  std::optional<NoiseFloor> floor_;
  std::deque<RawSample> samples_;
};

}  // namespace plumbline::app
