#include "rig/sim/frames.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace plumbline::sim {
namespace {

/// Little-endian (Intel) value into `bytes` bytes of the frame; the sign needs no care because
/// two's complement is cut off at the top.
void put(can_frame& frame, std::size_t at, std::size_t bytes, std::int64_t value) {
  for (std::size_t i = 0; i < bytes; ++i) {
    frame.data[at + i] = static_cast<std::uint8_t>((value >> (8 * i)) & 0xFF);
  }
}

/// Physical value to the steps of its signal, held at the ends of the signal's range.
template <class Raw>
std::int64_t steps(double value, double factor) {
  const double raw = std::round(value / factor);
  return static_cast<std::int64_t>(
      std::clamp(raw, static_cast<double>(std::numeric_limits<Raw>::min()),
                 static_cast<double>(std::numeric_limits<Raw>::max())));
}

can_frame empty_frame(canid_t id) {
  can_frame frame{};
  frame.can_id = id;
  frame.can_dlc = 8;
  return frame;
}

}  // namespace

std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t crc) {
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) {
      crc = static_cast<std::uint8_t>((crc & 0x80) != 0 ? (crc << 1) ^ 0x1D : crc << 1);
    }
  }
  return crc;
}

std::array<can_frame, 2> encode_sample(const NodeSample& sample) {
  can_frame a = empty_frame(kFrameA_id);
  put(a, 0, 1, sample.counter);
  put(a, 1, 1, sample.clipped ? kStatusClipped : 0);
  put(a, 2, 3, sample.code[0]);
  put(a, 5, 3, sample.code[1]);

  can_frame b = empty_frame(kFrameB_id);
  put(b, 0, 1, sample.counter);
  put(b, 1, 2, steps<std::int16_t>(sample.temp_C, 0.01));
  put(b, 3, 3, sample.code[2]);
  put(b, 6, 1, sample.counter >> 8);
  b.data[7] = crc8({b.data, 7}, crc8({a.data, 8}));
  return {a, b};
}

can_frame encode_environment(const NodeSample& sample) {
  can_frame frame = empty_frame(kEnvironment_id);
  put(frame, 0, 2, steps<std::uint16_t>(sample.rh_pct, 0.01));
  put(frame, 2, 2, steps<std::uint16_t>(sample.supply_V, 0.001));
  put(frame, 4, 2, steps<std::int16_t>(sample.motor_A, 0.001));
  return frame;
}

can_frame encode_identity(std::uint32_t serial_number) {
  can_frame frame = empty_frame(kIdentity_id);
  frame.can_dlc = 4;
  put(frame, 0, 4, serial_number);
  return frame;
}

}  // namespace plumbline::sim
