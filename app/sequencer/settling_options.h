// When a pose counts as settled: [settling] of rig.toml.
#pragma once

namespace plumbline::app {

/// A pose is accepted once the head has reported "in position" for `hold_s` and, over a window of
/// the latest samples, slope and variance lie within what the noise leaves; or at the hard cap.
struct SettlingOptions {
  double hold_s = 0.1;        ///< "in position" without interruption
  int window = 20;            ///< samples judged together
  double sigma_factor = 4.0;  ///< how many times the noise floor slope and deviation may reach
  double cap_s = 10.0;        ///< accepted at the latest then, and recorded as capped
};

}  // namespace plumbline::app
