// DBC files: which bits of which CAN frame mean what. Messages (BO_) and signals (SG_) are read;
// the other statements of the format are skipped.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::rig {

struct DbcSignal {
  std::string name;
  int start_bit = 0;  ///< as in the file: of the LSB when little endian, of the MSB when big endian
  int length = 1;     ///< bits, 1 … 64
  bool little_endian = true;
  bool is_signed = false;
  double factor = 1;
  double offset = 0;
  std::string unit;

  /// The raw value, sign-extended; nothing when the data is too short to hold the signal.
  std::optional<std::int64_t> raw(std::span<const std::uint8_t> data) const;
  /// factor·raw + offset, in `unit`.
  std::optional<double> physical(std::span<const std::uint8_t> data) const;
  /// Index of the last data byte that the signal touches.
  int last_byte() const;
};

struct DbcMessage {
  std::uint32_t id = 0;
  bool extended = false;  ///< 29-bit identifier
  std::string name;
  int length = 0;  ///< bytes
  std::vector<DbcSignal> signals;

  const DbcSignal* find(std::string_view signal) const;
};

struct Dbc {
  std::vector<DbcMessage> messages;

  const DbcMessage* find(std::string_view message) const;
};

/// `name` stands in front of messages: "node.dbc:12: …" (ErrorCode::input).
Result<Dbc> parse_dbc(std::string_view text, const std::string& name);

/// The layout that comes with the program.
std::string_view default_dbc_text();

}  // namespace plumbline::rig
