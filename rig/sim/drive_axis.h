// One axis of the simulated motor drive: its registers, its commands, its alarms, homing.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "rig/sim/axis.h"
#include "rig/sim/drive_settings.h"

namespace plumbline::sim {

// Register offsets within one axis; 32-bit values take two registers.
namespace reg {
inline constexpr int kCommand = 0x00;
inline constexpr int kTarget = 0x02;
inline constexpr int kSpeed = 0x04;
inline constexpr int kAcceleration = 0x06;
inline constexpr int kDeceleration = 0x08;
inline constexpr int kMode = 0x0A;
inline constexpr int kSequence = 0x0B;
inline constexpr int kWatchdog = 0x10;
inline constexpr int kLowerLimit = 0x12;
inline constexpr int kUpperLimit = 0x14;
inline constexpr int kStatus = 0x20;
inline constexpr int kAlarm = 0x21;
inline constexpr int kPosition = 0x22;
inline constexpr int kCommandedPosition = 0x24;
inline constexpr int kTargetEcho = 0x26;
inline constexpr int kActualSpeed = 0x28;
inline constexpr int kSequenceEcho = 0x2A;
inline constexpr int kHeartbeat = 0x2B;
inline constexpr int kTemperature = 0x2C;
inline constexpr int kCount = 0x2D;
}  // namespace reg

// Bits of the command register: START and the like act on the edge from 0 to 1; JOG moves while
// set.
namespace command {
inline constexpr std::uint16_t kStart = 1u << 3;
inline constexpr std::uint16_t kHome = 1u << 4;
inline constexpr std::uint16_t kStop = 1u << 5;
inline constexpr std::uint16_t kFree = 1u << 6;
inline constexpr std::uint16_t kAlarmReset = 1u << 7;
inline constexpr std::uint16_t kJogPlus = 1u << 12;
inline constexpr std::uint16_t kJogMinus = 1u << 13;
}  // namespace command

// Bits of the status register.
namespace status {
inline constexpr std::uint16_t kEnabled = 1u << 0;
inline constexpr std::uint16_t kLimitPlus = 1u << 1;
inline constexpr std::uint16_t kLimitMinus = 1u << 2;
inline constexpr std::uint16_t kFollowingError = 1u << 3;
inline constexpr std::uint16_t kHomeEnd = 1u << 4;
inline constexpr std::uint16_t kReady = 1u << 5;
inline constexpr std::uint16_t kInfo = 1u << 6;
inline constexpr std::uint16_t kAlarm = 1u << 7;
inline constexpr std::uint16_t kBusy = 1u << 8;
inline constexpr std::uint16_t kMove = 1u << 13;
inline constexpr std::uint16_t kInPosition = 1u << 14;
inline constexpr std::uint16_t kTorqueLimit = 1u << 15;
}  // namespace status

namespace alarm {
inline constexpr std::uint16_t kFollowingError = 0x10;
inline constexpr std::uint16_t kLimitSwitch = 0x60;
inline constexpr std::uint16_t kSoftLimit = 0x66;
inline constexpr std::uint16_t kCommunication = 0x84;
}  // namespace alarm

enum class LimitSwitch { none, minus, plus };

/// Times are world times and never go back. Not thread safe.
class DriveAxis {
 public:
  DriveAxis(const DriveSettings& settings, std::size_t index);

  /// Lets everything happen that is due up to t_s: phases of homing, alarms, warming.
  void advance(double t_s);
  AxisState state(double t_s) const { return axis_.at(t_s); }

  /// True when the registers [offset, offset + count) may be written.
  static bool writable(int offset, int count);
  /// True when the drive takes these values.
  static bool acceptable(int offset, std::span<const std::uint16_t> words);
  /// Stores words and acts on the command among them. Returns true when a START was accepted.
  bool write(int offset, std::span<const std::uint16_t> words, double t_s);
  /// All registers as a reader finds them; `heartbeat` goes into its register.
  std::array<std::uint16_t, reg::kCount> image(double t_s, std::uint16_t heartbeat) const;

  std::uint16_t watchdog_ms() const { return registers_[reg::kWatchdog]; }
  /// Stops the axis; a second alarm on top of the first is not recorded.
  void raise_alarm(std::uint16_t code, double t_s);

  // What faults do to it.
  void stall(double t_s) { axis_.block(t_s), stalled_ = true; }
  void slip(double deg) { axis_.slip(deg); }
  void trip_limit_switch(double t_s);
  void lose_homing() { homed_ = false; }

 private:
  enum class Homing { none, searching, returning };

  std::int32_t value32(int offset) const;
  void put32(std::span<std::uint16_t> words, int offset, std::int64_t value) const;
  std::int64_t counts(double deg) const;
  bool usable() const { return enabled_ && alarm_ == 0; }
  bool start(double t_s);
  void home(double t_s);
  void stop(double t_s);
  void jog(std::uint16_t edges_up, std::uint16_t edges_down, double t_s);
  void reset_alarm();
  double register_deg(int offset) const { return value32(offset) / counts_per_deg_; }

  Axis axis_;
  double counts_per_deg_;
  bool high_word_first_;
  double following_error_deg_;
  std::array<std::uint16_t, reg::kStatus> registers_{};  ///< what the host writes
  bool enabled_ = true;
  bool homed_ = false;
  bool info_ = false;  ///< the last START, HOME or JOG was not taken
  bool stalled_ = false;
  LimitSwitch limit_switch_ = LimitSwitch::none;
  Homing homing_ = Homing::none;
  std::uint16_t alarm_ = 0;
  std::int32_t target_echo_ = 0;
  std::uint16_t sequence_echo_ = 0;
  double warming_K_ = 0;  ///< of the power stage above its surroundings
  double advanced_s_ = 0;
};

}  // namespace plumbline::sim
