// The drive's holding registers: values to 16-bit words and back. Pure: no bus, no clock.
//
// Offsets, status bits and command bits are those of the simulated head unless the configuration
// says otherwise under [head.registers], [head.status_bits] and [head.command_bits], so that
// another drive is mapped without touching code.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "rig/strict_toml.h"

namespace plumbline::rig {

/// Order of the two words of a 32-bit value.
enum class WordOrder { high_first, low_first };

/// Register offsets relative to the axis base.
struct RegisterOffsets {
  int command = 0x00;        ///< u16, edge-triggered bits
  int target = 0x02;         ///< i32, counts
  int speed = 0x04;          ///< u32, counts/s
  int acceleration = 0x06;   ///< u32, counts/s²
  int deceleration = 0x08;   ///< u32, counts/s²
  int mode = 0x0A;           ///< u16, 1 absolute
  int sequence = 0x0B;       ///< u16, number of the command
  int watchdog = 0x10;       ///< u16, ms, 0 = off
  int limit_lower = 0x12;    ///< i32, counts
  int limit_upper = 0x14;    ///< i32, counts
  int status = 0x20;         ///< u16
  int alarm = 0x21;          ///< u16
  int position = 0x22;       ///< i32, counts, encoder
  int target_echo = 0x26;    ///< i32, target of the accepted command
  int sequence_echo = 0x2A;  ///< u16, number of the accepted command
  int temperature = 0x2C;    ///< i16, 0.1 °C
};

/// Bit numbers in the status register.
struct StatusBits {
  int enabled = 0;
  int home_end = 4;
  int ready = 5;
  int alarm = 7;
  int busy = 8;
  int move = 13;
  int in_position = 14;
};

/// Bit numbers in the command register.
struct CommandBits {
  int start = 3;
  int home = 4;
  int stop = 5;
  int alarm_reset = 7;
};

struct RegisterMap {
  WordOrder word_order = WordOrder::high_first;
  RegisterOffsets offset;
  StatusBits status_bit;
  CommandBits command_bit;
};

/// Consecutive registers, relative to the axis base.
struct RegisterBlock {
  int offset = 0;
  int count = 0;
};

/// Values for consecutive registers, relative to the axis base.
struct RegisterWrite {
  int offset = 0;
  std::vector<std::uint16_t> words;

  bool operator==(const RegisterWrite&) const = default;
};

/// Parameters of an absolute move, in counts.
struct MoveCommand {
  std::int32_t target = 0;
  std::uint32_t speed = 0;
  std::uint32_t acceleration = 0;
  std::uint32_t deceleration = 0;
  std::uint16_t sequence = 0;
};

/// What one reading of the status block says about one axis.
struct AxisStatus {
  bool enabled = false;
  bool homed = false;
  bool ready = false;
  bool alarmed = false;
  bool moving = false;       ///< MOVE or BUSY
  bool in_position = false;  ///< the bit alone; see confirms()
  std::uint16_t alarm = 0;
  std::int32_t position = 0;
  std::int32_t target_echo = 0;
  std::uint16_t sequence_echo = 0;
  double temperature_C = 0;

  /// True when the drive reports having accepted exactly this command.
  bool confirms(const MoveCommand& command) const {
    return target_echo == command.target && sequence_echo == command.sequence;
  }
};

/// The span of registers that holds the whole status: it is read in one request, so that its
/// values belong to one another.
RegisterBlock status_block(const RegisterMap& map);
/// `words` are those of status_block(), in order.
AxisStatus decode_status(const RegisterMap& map, std::span<const std::uint16_t> words);

/// The writes that set up a move, adjacent registers joined; START is not among them.
std::vector<RegisterWrite> encode_move(const RegisterMap& map, const MoveCommand& move);

/// Two words as a 32-bit value and back.
std::uint32_t join_words(WordOrder order, std::uint16_t first, std::uint16_t second);
std::array<std::uint16_t, 2> split_words(WordOrder order, std::uint32_t value);

/// Reads word_order, [registers], [status_bits] and [command_bits] of the [head] table.
RegisterMap read_register_map(StrictTable& head);

}  // namespace plumbline::rig
