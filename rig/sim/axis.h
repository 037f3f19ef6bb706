// One motorised axis of the simulated head: trapezoidal profile, overshoot, settling, encoder.
#pragma once

namespace plumbline::sim {

/// [drive] of world.toml, one per axis.
struct AxisDynamics {
  double speed_deg_s = 30;  ///< largest speed; a command may ask for less
  double acceleration_deg_s2 = 60;
  double overshoot_deg = 0.02;  ///< first peak past the target on arrival
  double settling_hz = 8;       ///< of the decaying oscillation after arrival
  double settling_tau_s = 0.12;
  double encoder_resolution_deg = 1.0 / 3600.0;
  double in_position_window_deg = 0.005;
  double in_position_hold_s = 0.05;
  double lower_limit_deg = -370;  ///< mechanical
  double upper_limit_deg = 370;
  double home_offset_deg = 0;  ///< true angle at encoder zero after homing
};

/// Where the axis is at one instant of world time.
struct AxisState {
  double angle_deg = 0;    ///< true mechanical angle
  double encoder_deg = 0;  ///< what the encoder says, rounded to its resolution
  double speed_deg_s = 0;
  bool moving = false;       ///< the profile has not ended
  bool in_position = false;  ///< the profile has ended and the window has been held
};

/// World time only moves forward: at() must be called with non-decreasing times.
class Axis {
 public:
  explicit Axis(const AxisDynamics& dynamics);
  /// Starts a move at world time t_s with the given (or largest) speed and acceleration.
  void start_move(double t_s, double target_deg, double speed_deg_s, double acceleration_deg_s2,
                  double deceleration_deg_s2);
  /// Decelerates to rest from whatever it is doing.
  void stop(double t_s);
  /// The axis loses `deg` of true angle against its encoder (slip).
  void slip(double deg);
  AxisState at(double t_s);

 private:
  AxisDynamics dynamics_;
  double start_s_ = 0, start_deg_ = 0, target_deg_ = 0, end_s_ = 0;
  double direction_ = 0, accelerate_s_ = 0, cruise_s_ = 0, brake_s_ = 0, peak_deg_s_ = 0;
  double slip_deg_ = 0;
};

}  // namespace plumbline::sim
