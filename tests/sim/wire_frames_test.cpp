// The node's frames against literal bytes, and what faults make of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>

#include <set>

#include "rig/sim/frames.h"
#include "rig/sim/node_frames.h"

namespace plumbline::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;

std::vector<int> bytes(const can_frame& frame) { return {frame.data, frame.data + frame.can_dlc}; }

NodeSample sample(std::int64_t counter) {
  NodeSample s;
  s.counter = counter;
  s.t_s = 0.01 * static_cast<double>(counter);
  s.code = {-2, 0x123, -8388608};
  s.temp_C = 21.37;
  s.rh_pct = 45.67;
  s.supply_V = 4.999;
  s.motor_A = -0.25;
  return s;
}

// The catalogue of CRC algorithms names this one CRC-8/GSM-A: check value 37h.
TEST(WireFrames, CrcOfTheCheckString) {
  const std::array<std::uint8_t, 9> digits = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(crc8(digits), 0x37);
  EXPECT_EQ(crc8(std::span(digits).subspan(4), crc8(std::span(digits).first(4))), 0x37);
  EXPECT_EQ(crc8(std::array<std::uint8_t, 1>{1}), 0x1D);  // x⁸ mod polynomial
}

// Counter 0102h, status 1, X = −2 = FFFFFEh, Y = 000123h, temperature 2137 = 0859h, Z = 800000h.
// CRC: the 15 bytes as a polynomial over GF(2), times x⁸, leave 9Ch on division by 11Dh.
TEST(WireFrames, SampleToLiteralBytes) {
  NodeSample s = sample(0x0102);
  s.clipped = true;
  const auto [a, b] = encode_sample(s);
  EXPECT_EQ(a.can_id, 416u);
  EXPECT_EQ(b.can_id, 417u);
  EXPECT_THAT(bytes(a), ElementsAre(0x02, 0x01, 0xFE, 0xFF, 0xFF, 0x23, 0x01, 0x00));
  EXPECT_THAT(bytes(b), ElementsAre(0x02, 0x59, 0x08, 0x00, 0x00, 0x80, 0x01, 0x9C));
}

// 4567 = 11D7h, 4999 = 1387h, −250 = FF06h.
TEST(WireFrames, EnvironmentToLiteralBytes) {
  const can_frame frame = encode_environment(sample(0));
  EXPECT_EQ(frame.can_id, 418u);
  EXPECT_THAT(bytes(frame), ElementsAre(0xD7, 0x11, 0x87, 0x13, 0x06, 0xFF, 0, 0));
}

TEST(WireFrames, ValuesOutsideTheirSignalAreHeldAtItsEnd) {
  NodeSample s = sample(0);
  s.supply_V = 100;
  s.rh_pct = -1;
  s.temp_C = -400;
  const can_frame frame = encode_environment(s);
  EXPECT_THAT(bytes(frame), ElementsAre(0, 0, 0xFF, 0xFF, 0x06, 0xFF, 0, 0));
  EXPECT_EQ(encode_sample(s)[1].data[1], 0x00);
  EXPECT_EQ(encode_sample(s)[1].data[2], 0x80);
}

Faults one_fault(Fault fault) { return {.all = {fault}}; }

std::vector<can_frame> stream(const Faults& faults, int samples) {
  NodeFrames frames(100, 24, faults, 5);
  std::vector<can_frame> all;
  for (int i = 0; i < samples; ++i) {
    for (const can_frame& frame : frames.at(sample(i), 0)) all.push_back(frame);
  }
  return all;
}

std::vector<canid_t> ids(const std::vector<can_frame>& frames) {
  std::vector<canid_t> result;
  for (const can_frame& frame : frames) result.push_back(frame.can_id);
  return result;
}

// 10 Hz beside 100 Hz: with samples 0, 10, 20 …
TEST(WireFrames, EnvironmentComesTenTimesASecond) {
  const auto all = ids(stream({}, 100));
  EXPECT_EQ(all.size(), 210u);
  EXPECT_EQ(std::count(all.begin(), all.end(), 418u), 10);
  EXPECT_EQ(all[2], 418u);
  EXPECT_EQ(all[2 + 21], 418u);
}

TEST(WireFrames, LossTakesAwayItsShare) {
  const auto all =
      stream(one_fault({.kind = FaultKind::can_loss, .count = 0, .probability = 0.1}), 1000);
  EXPECT_NEAR(static_cast<double>(all.size()), 2100 * 0.9, 5 * 13.7);  // √(2100·0.1·0.9)
}

TEST(WireFrames, ReorderSwapsTwoNeighbours) {
  const Faults faults = one_fault({.kind = FaultKind::can_reorder, .after = 3});
  EXPECT_THAT(ids(stream(faults, 3)), ElementsAre(416, 417, 418, 417, 416, 416, 417));
}

TEST(WireFrames, DuplicateComesTwice) {
  const Faults faults = one_fault({.kind = FaultKind::can_duplicate, .after = 1});
  EXPECT_THAT(ids(stream(faults, 2)), ElementsAre(416, 417, 417, 418, 416, 417));
}

TEST(WireFrames, SilenceLeavesACounterGap) {
  const Faults faults =
      one_fault({.kind = FaultKind::can_silence, .at_s = 0.02, .duration_s = 0.03, .count = 0});
  std::set<int> seen;
  for (const can_frame& frame : stream(faults, 8)) {
    if (frame.can_id == 416) seen.insert(frame.data[0]);
  }
  EXPECT_THAT(seen, ElementsAre(0, 1, 5, 6, 7));
}

TEST(WireFrames, StuckAndSaturatedCodes) {
  NodeFrames frames(100, 16,
                    {.all = {{.kind = FaultKind::can_stuck_code, .after = 1, .count = 2, .axis = 1},
                             {.kind = FaultKind::can_saturation, .after = 2, .axis = 0}}},
                    1);
  std::vector<std::vector<int>> seen;
  for (int i = 0; i < 4; ++i) {
    NodeSample s = sample(i);
    s.code = {10 + i, 20 + i, 30 + i};
    seen.push_back(bytes(frames.at(s, 0).front()));
  }
  EXPECT_THAT(seen[0], ElementsAre(0, 0, 10, 0, 0, 20, 0, 0));
  EXPECT_THAT(seen[1], ElementsAre(1, 0, 11, 0, 0, 21, 0, 0));
  EXPECT_THAT(seen[2], ElementsAre(2, 1, 0xFF, 0x7F, 0, 21, 0, 0));
  EXPECT_THAT(seen[3], ElementsAre(3, 0, 13, 0, 0, 23, 0, 0));
}

TEST(WireFrames, ErrorFrameIsBusOff) {
  const auto all =
      stream(one_fault({.kind = FaultKind::can_error_frame, .after = 1, .value = 0x40}), 2);
  ASSERT_EQ(all.size(), 6u);
  EXPECT_EQ(all[3].can_id, CAN_ERR_FLAG | CAN_ERR_BUSOFF);
  EXPECT_EQ(all[3].can_dlc, 8);
}

TEST(Frames, TheSerialNumberIsSentOnceASecond) {
  const can_frame identity = encode_identity(0x01020304);
  EXPECT_EQ(identity.can_id, 419u);
  EXPECT_EQ(identity.can_dlc, 4);
  EXPECT_EQ(identity.data[0], 4);
  EXPECT_EQ(identity.data[3], 1);
  NodeFrames frames(10, 16, {}, 1, 7);
  NodeFrames anonymous(10, 16, {}, 1);
  int sent = 0;
  for (int counter = 0; counter < 30; ++counter) {
    NodeSample sample;
    sample.counter = counter;
    for (const can_frame& frame : frames.at(sample, 0)) sent += frame.can_id == kIdentity_id;
    for (const can_frame& frame : anonymous.at(sample, 0)) EXPECT_NE(frame.can_id, kIdentity_id);
  }
  EXPECT_EQ(sent, 3);
}

}  // namespace
}  // namespace plumbline::sim
