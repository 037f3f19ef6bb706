// Frames of the default layout, written out by hand for the tests.
#pragma once

#include <cstdint>
#include <utility>

#include "rig/carrier.h"
#include "rig/dbc.h"
#include "rig/frame_layout.h"

namespace plumbline::rig {

/// CRC-8 by table-free long division, bit by bit: on its own so that the code under test is held
/// against something else.
inline std::uint8_t reference_crc(const CanFrame& a, const CanFrame& b) {
  unsigned remainder = 0;
  const auto feed = [&](std::uint8_t byte) {
    for (int bit = 7; bit >= 0; --bit) {
      const unsigned out = (remainder >> 7) & 1u;
      remainder = ((remainder << 1) & 0xFFu) ^ ((out ^ ((byte >> bit) & 1u)) != 0 ? 0x1Du : 0u);
    }
  };
  for (int i = 0; i < 8; ++i) feed(a.data[static_cast<std::size_t>(i)]);
  for (int i = 0; i < 7; ++i) feed(b.data[static_cast<std::size_t>(i)]);
  return static_cast<std::uint8_t>(remainder);
}

struct SampleFrames {
  CanFrame a;
  CanFrame b;
};

/// ACC_A and ACC_B of one sample.
inline SampleFrames sample_frames(int counter, std::int32_t x, std::int32_t y, std::int32_t z,
                                  int centi_C = 2000, std::uint8_t status = 0) {
  const auto byte = [](std::int32_t value, int index) {
    return static_cast<std::uint8_t>((static_cast<std::uint32_t>(value) >> (8 * index)) & 0xFF);
  };
  SampleFrames frames;
  frames.a.id = 416;
  frames.a.length = 8;
  frames.a.data = {byte(counter, 0), status,     byte(x, 0), byte(x, 1),
                   byte(x, 2),       byte(y, 0), byte(y, 1), byte(y, 2)};
  frames.b.id = 417;
  frames.b.length = 8;
  frames.b.data = {byte(counter, 0), byte(centi_C, 0), byte(centi_C, 1), byte(z, 0),
                   byte(z, 1),       byte(z, 2),       byte(counter, 1), 0};
  frames.b.data[7] = reference_crc(frames.a, frames.b);
  return frames;
}

inline FrameLayout default_layout(const std::vector<CovariateSignal>& covariates = {}) {
  return *FrameLayout::bind(*parse_dbc(default_dbc_text(), "plumbline.dbc"), SignalRoles{},
                            covariates);
}

}  // namespace plumbline::rig
