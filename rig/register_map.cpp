#include "rig/register_map.h"

#include <algorithm>
#include <cassert>
#include <initializer_list>

namespace plumbline::rig {

namespace {

constexpr std::uint16_t kModeAbsolute = 1;
constexpr int kMaxReadRegisters = 125;  // Modbus application protocol V1.1b3, 6.3

bool bit(std::uint16_t word, int number) { return ((word >> number) & 1) != 0; }

}  // namespace

std::uint32_t join_words(WordOrder order, std::uint16_t first, std::uint16_t second) {
  const std::uint32_t high = order == WordOrder::high_first ? first : second;
  const std::uint32_t low = order == WordOrder::high_first ? second : first;
  return (high << 16) | low;
}

std::array<std::uint16_t, 2> split_words(WordOrder order, std::uint32_t value) {
  const auto high = static_cast<std::uint16_t>(value >> 16);
  const auto low = static_cast<std::uint16_t>(value & 0xFFFF);
  if (order == WordOrder::high_first) return {high, low};
  return {low, high};
}

RegisterBlock status_block(const RegisterMap& map) {
  const RegisterOffsets& at = map.offset;
  const int first = std::min(
      {at.status, at.alarm, at.position, at.target_echo, at.sequence_echo, at.temperature});
  const int end = std::max({at.status + 1, at.alarm + 1, at.position + 2, at.target_echo + 2,
                            at.sequence_echo + 1, at.temperature + 1});
  return {first, end - first};
}

AxisStatus decode_status(const RegisterMap& map, std::span<const std::uint16_t> words) {
  const RegisterBlock block = status_block(map);
  assert(words.size() == static_cast<std::size_t>(block.count));
  const auto word = [&](int offset) {
    return words[static_cast<std::size_t>(offset - block.offset)];
  };
  const auto value32 = [&](int offset) {
    return static_cast<std::int32_t>(join_words(map.word_order, word(offset), word(offset + 1)));
  };
  const std::uint16_t bits = word(map.offset.status);
  AxisStatus status;
  status.enabled = bit(bits, map.status_bit.enabled);
  status.homed = bit(bits, map.status_bit.home_end);
  status.ready = bit(bits, map.status_bit.ready);
  status.alarmed = bit(bits, map.status_bit.alarm);
  status.moving = bit(bits, map.status_bit.move) || bit(bits, map.status_bit.busy);
  status.in_position = bit(bits, map.status_bit.in_position);
  status.alarm = word(map.offset.alarm);
  status.position = value32(map.offset.position);
  status.target_echo = value32(map.offset.target_echo);
  status.sequence_echo = word(map.offset.sequence_echo);
  status.temperature_C = 0.1 * static_cast<std::int16_t>(word(map.offset.temperature));
  return status;
}

std::vector<RegisterWrite> encode_move(const RegisterMap& map, const MoveCommand& move) {
  std::vector<RegisterWrite> writes;
  const auto add32 = [&](int offset, std::uint32_t value) {
    const auto words = split_words(map.word_order, value);
    writes.push_back({offset, {words[0], words[1]}});
  };
  const RegisterOffsets& at = map.offset;
  add32(at.target, static_cast<std::uint32_t>(move.target));
  add32(at.speed, move.speed);
  add32(at.acceleration, move.acceleration);
  add32(at.deceleration, move.deceleration);
  writes.push_back({at.mode, {kModeAbsolute}});
  writes.push_back({at.sequence, {move.sequence}});
  std::sort(writes.begin(), writes.end(),
            [](const RegisterWrite& a, const RegisterWrite& b) { return a.offset < b.offset; });

  std::vector<RegisterWrite> joined;
  for (RegisterWrite& write : writes) {
    if (!joined.empty() &&
        joined.back().offset + static_cast<int>(joined.back().words.size()) == write.offset) {
      joined.back().words.insert(joined.back().words.end(), write.words.begin(), write.words.end());
    } else {
      joined.push_back(std::move(write));
    }
  }
  return joined;
}

RegisterMap read_register_map(StrictTable& head) {
  RegisterMap map;
  if (head.choice_or("word_order", "high_first", {"high_first", "low_first"}) == "low_first") {
    map.word_order = WordOrder::low_first;
  }
  struct Entry {
    const char* name;
    int* value;
  };
  const auto read = [](StrictTable table, std::initializer_list<Entry> entries, double largest) {
    for (const Entry& entry : entries) {
      *entry.value =
          static_cast<int>(table.integer_or(entry.name, *entry.value, {.min = 0, .max = largest}));
    }
  };
  RegisterOffsets& at = map.offset;
  read(head.table("registers"),
       {{"command", &at.command},
        {"target", &at.target},
        {"speed", &at.speed},
        {"acceleration", &at.acceleration},
        {"deceleration", &at.deceleration},
        {"mode", &at.mode},
        {"sequence", &at.sequence},
        {"watchdog", &at.watchdog},
        {"limit_lower", &at.limit_lower},
        {"limit_upper", &at.limit_upper},
        {"status", &at.status},
        {"alarm", &at.alarm},
        {"position", &at.position},
        {"target_echo", &at.target_echo},
        {"sequence_echo", &at.sequence_echo},
        {"temperature", &at.temperature}},
       65533);
  read(head.table("status_bits"),
       {{"enabled", &map.status_bit.enabled},
        {"home_end", &map.status_bit.home_end},
        {"ready", &map.status_bit.ready},
        {"alarm", &map.status_bit.alarm},
        {"busy", &map.status_bit.busy},
        {"move", &map.status_bit.move},
        {"in_position", &map.status_bit.in_position}},
       15);
  read(head.table("command_bits"),
       {{"start", &map.command_bit.start},
        {"home", &map.command_bit.home},
        {"stop", &map.command_bit.stop},
        {"alarm_reset", &map.command_bit.alarm_reset}},
       15);
  if (status_block(map).count > kMaxReadRegisters) {
    head.refuse("registers",
                "the status registers must lie within 125 of one another to be read at once");
  }
  return map;
}

}  // namespace plumbline::rig
