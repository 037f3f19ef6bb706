// One motorised axis of the simulated head: trapezoidal profile, overshoot, settling, encoder.
#pragma once

#include <array>
#include <optional>

namespace plumbline::sim {

/// What the mechanics and the servo of one axis can do ([drive.delta] and [drive.h] of world.toml).
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
  double power_on_deg = 3;     ///< true angle at power on, where the encoder reads zero
  double home_switch_deg = -5;
  double homing_speed_deg_s = 10;
};

/// Where the axis is at one instant of world time.
struct AxisState {
  double angle_deg = 0;      ///< true mechanical angle
  double encoder_deg = 0;    ///< what the encoder says, rounded to its resolution
  double commanded_deg = 0;  ///< where the profile wants the encoder to be
  double speed_deg_s = 0;    ///< of the profile; the settling oscillation is not in it
  bool moving = false;       ///< the profile has not ended
  bool in_position = false;  ///< the profile has ended and the window has been held
};

/// Piecewise constant acceleration in closed form: evaluating it costs the same whatever the time
/// step, and two axes asked in different rhythms give the same motion.
///
/// Angles handed in are encoder angles. A motion starts at or after the latest time asked for;
/// at() may then be asked for any time from the start of that motion on.
class Axis {
 public:
  explicit Axis(const AxisDynamics& dynamics);

  /// Starts a move at world time t_s, with speed and accelerations up to those of the dynamics
  /// (larger or non-positive values mean: the largest). A moving axis brakes to rest first.
  void start_move(double t_s, double target_deg, double speed_deg_s, double acceleration_deg_s2,
                  double deceleration_deg_s2);
  /// Decelerates to rest from whatever it is doing, with the deceleration of the current move.
  void stop(double t_s);
  /// The shaft stays where it is while the profile goes on: following error grows.
  void block(double t_s);
  /// The profile ends here and now, without deceleration or oscillation; ends a block().
  void freeze(double t_s);
  /// The shaft loses `deg` of true angle against its encoder.
  void slip(double deg);
  /// The encoder is set from the home switch: afterwards true angle = encoder + home_offset_deg.
  /// Only while the axis is at rest; the target becomes the place where it stands.
  void reference(double t_s);

  AxisState at(double t_s) const;
  /// World time at which the profile ends; the oscillation goes on after it.
  double end_s() const { return end_s_; }
  /// Encoder angle at which the home switch is met.
  double home_switch_encoder_deg() const { return dynamics_.home_switch_deg - true_minus_encoder_; }
  const AxisDynamics& dynamics() const { return dynamics_; }

 private:
  struct Phase {
    double start_s = 0;
    double duration_s = 0;
    double start_deg = 0;
    double start_deg_s = 0;
    double acceleration_deg_s2 = 0;
  };
  struct Point {
    double deg = 0;
    double deg_s = 0;
  };
  Point profile(double t_s) const;
  double ringing_deg(double t_s) const;
  void begin(double t_s, double rest_deg);
  Point append(Point from, double duration_s, double acceleration_deg_s2);
  void finish(double travel_deg);

  AxisDynamics dynamics_;
  std::array<Phase, 4> phase_;  ///< brake, accelerate, cruise, decelerate; unused ones are left out
  std::size_t phases_ = 0;
  double end_s_ = 0;
  double end_deg_ = 0;
  double target_deg_ = 0;
  double deceleration_deg_s2_ = 0;
  double ringing_amplitude_deg_ = 0;  ///< signed by the direction of arrival
  double settled_s_ = 0;              ///< from here on the window has been held
  std::optional<double> blocked_deg_;
  double true_minus_encoder_ = 0;
};

}  // namespace plumbline::sim
