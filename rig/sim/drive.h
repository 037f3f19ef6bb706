// The simulated motor drive: two axes behind one register map, the watchdog, faults of the drive.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <span>

#include "rig/sim/drive_axis.h"
#include "rig/sim/faults.h"
#include "rig/sim/unit.h"

namespace plumbline::sim {

/// Registers of axis i start at i·0x100.
inline constexpr int kAxisBase = 0x100;
/// Read-only: serial number (u32), type and firmware of the drive.
inline constexpr int kNameplate = 0x200;
inline constexpr int kNameplateCount = 4;
inline constexpr int kRegisterEnd = kNameplate + kNameplateCount;

/// Modbus exception codes, as far as the drive itself gives them.
enum class Refusal { none = 0, illegal_address = 2, illegal_value = 3 };

/// Two clocks run here. `t_s` is world time, by which everything mechanical goes. The watchdog
/// goes by the host's clock instead: it watches over a program that polls every few milliseconds
/// however fast the world runs; at 200× a watchdog of 1 s in world time would bite after 5 ms.
///
/// Not thread safe. Both clocks never go back.
class Drive {
 public:
  using HostTime = std::chrono::steady_clock::time_point;

  Drive(const DriveSettings& settings, const Faults& faults, std::uint64_t seed);

  /// Lets everything happen that is due up to t_s.
  void advance(double t_s);
  /// Stops the axes whose watchdog has expired.
  void check_watchdog(double t_s, HostTime now);
  /// Any request keeps the watchdog quiet and moves the heartbeat on.
  void note_request(HostTime now);
  /// The epoch before the first one.
  HostTime last_request() const { return last_request_; }

  static Refusal check_read(int address, int count);
  static Refusal check_write(int address, std::span<const std::uint16_t> words);
  /// Stores and acts on what check_write() has let pass.
  void write(int address, std::span<const std::uint16_t> words, double t_s);
  /// Fills the registers [0, kRegisterEnd) as a reader finds them at t_s.
  void image(double t_s, std::span<std::uint16_t> registers) const;

  HeadState head(double t_s) const { return {axes_[0].state(t_s), axes_[1].state(t_s)}; }
  /// Motions started so far. A motion of the head is one START for each axis that takes part, so
  /// the axis with more of them counts.
  std::int64_t moves() const { return std::max(starts_[0], starts_[1]); }

 private:
  void apply(const std::vector<const Fault*>& faults, double t_s);

  std::array<DriveAxis, 2> axes_;
  std::array<std::uint16_t, kNameplateCount> nameplate_;
  std::array<std::int64_t, 2> starts_{};
  FaultInjector faults_;
  HostTime last_request_{};
  std::uint16_t heartbeat_ = 0;
};

}  // namespace plumbline::sim
