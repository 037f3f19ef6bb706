// The motorised two-axis dividing head as the sequencer sees it.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>

#include "estimator/measurement.h"

namespace plumbline::rig {

/// Angles of the head, degrees: δ of the spindle, h of the tilt.
struct HeadAngles {
  double delta_deg = 0;
  double h_deg = 0;
};

/// One reading of both axes; only values that belong to one another are ever returned.
struct HeadStatus {
  HeadAngles actual;  ///< encoder readings
  bool in_position =
      false;  ///< both axes, confirmed by target echo and sequence echo of the last command
  bool moving = false;                   ///< any axis
  bool ready = false;                    ///< both axes enabled, ready and without alarm
  bool homed = false;                    ///< both axes
  std::array<std::uint16_t, 2> alarm{};  ///< alarm code per axis (δ, h), 0 = none; see alarm_text()
  std::array<double, 2> drive_temp_C{};
};

struct SoftLimits {
  HeadAngles lower;
  HeadAngles upper;
};

/// A dividing head. Not thread safe: one owner (the sequencer). Every call ends within its
/// deadline; failures are ErrorCode::rig.
class DividingHead {
 public:
  virtual ~DividingHead() = default;

  /// Connects and checks that a drive answers.
  virtual Result<void> connect() = 0;
  virtual Result<HeadStatus> status() = 0;
  virtual Result<SoftLimits> soft_limits() = 0;
  /// What the drive says it is (serial number and so on), always the same text for the same drive;
  /// empty when it does not say.
  virtual Result<std::string> identity() = 0;
  /// Starts homing of both axes; status().homed says when it is done.
  virtual Result<void> start_homing() = 0;
  /// Starts a move of both axes; status().in_position says when this move has ended.
  virtual Result<void> start_move(HeadAngles target) = 0;
  /// Stops both axes at once.
  virtual Result<void> stop() = 0;
  virtual Result<void> reset_alarm() = 0;
  /// Arms the drive's own watchdog: without a request for so long it stops. 0 disarms.
  virtual Result<void> arm_watchdog(std::chrono::milliseconds timeout) = 0;
};

/// "10h following error" and so on, for messages.
std::string alarm_text(std::uint16_t code);

}  // namespace plumbline::rig
