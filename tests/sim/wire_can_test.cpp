// The simulated node over a real Unix socket; frames are taken apart here by bit arithmetic alone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/sim/wire_rig.h"

namespace plumbline::sim {
namespace {

using ::testing::HasSubstr;

std::int32_t signed24(const std::uint8_t* p) {
  const std::int32_t value = p[0] | p[1] << 8 | p[2] << 16;
  return value >= 0x800000 ? value - 0x1000000 : value;
}

/// A frame is intact when A's 8 and B's 8 bytes, the CRC among them, divide by x⁸+x⁴+x³+x²+1.
bool divides(const can_frame& a, const can_frame& b) {
  unsigned rest = 0;
  for (const can_frame* frame : {&a, &b}) {
    for (int bit = 0; bit < 64; ++bit) {
      rest = rest << 1 | ((frame->data[bit / 8] >> (7 - bit % 8)) & 1u);
      if ((rest & 0x100u) != 0) rest ^= 0x11Du;
    }
  }
  return rest == 0;
}

struct Decoded {
  int counter = 0;
  PerAxis<std::int32_t> code{};
  double temp_C = 0;
};

/// Reads `count` samples; every A must be followed by its B.
std::vector<Decoded> read_samples(FrameClient& client, std::size_t count) {
  std::vector<Decoded> samples;
  can_frame a{};
  can_frame b{};
  while (samples.size() < count) {
    if (!client.next(a)) break;
    if (a.can_id != 416) continue;
    if (!client.next(b)) break;
    EXPECT_EQ(b.can_id, 417u);
    EXPECT_EQ(a.data[0], b.data[0]);
    EXPECT_TRUE(divides(a, b));
    Decoded sample;
    sample.counter = b.data[6] << 8 | a.data[0];
    sample.code = {signed24(&a.data[2]), signed24(&a.data[5]), signed24(&b.data[3])};
    sample.temp_C = 0.01 * static_cast<std::int16_t>(b.data[1] | b.data[2] << 8);
    samples.push_back(sample);
  }
  EXPECT_EQ(samples.size(), count);
  return samples;
}

void expect_without_gap(const std::vector<Decoded>& samples) {
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].counter, (samples[i - 1].counter + 1) & 0xFFFF) << "after " << i;
  }
}

TEST(WireCan, CounterHasNoGapAt200Times) {
  WireRig rig({}, 200);
  FrameClient client(rig.serve_can());
  expect_without_gap(read_samples(client, 10000));
}

// The same world and seed, asked without any wires in between.
TEST(WireCan, SamplesAreThoseOfTheUnit) {
  const World world;
  WireRig rig({}, 2, world);
  FrameClient client(rig.serve_can());
  Unit twin(world, 1);
  const HeadState power_on =
      rig.machine.with_drive([](Drive& drive, double) { return drive.head(0); });
  int next = 0;
  for (const Decoded& sample : read_samples(client, 50)) {
    NodeSample wanted;
    while (next <= sample.counter) {
      wanted = twin.next(power_on);
      ++next;
    }
    EXPECT_EQ(sample.code, wanted.code) << "sample " << sample.counter;
    EXPECT_NEAR(sample.temp_C, wanted.temp_C, 0.0051);
  }
}

TEST(WireCan, EnvironmentComesAtTenHertz) {
  WireRig rig({}, 100);
  FrameClient client(rig.serve_can());
  int pairs = 0;
  int environments = 0;
  can_frame frame{};
  while (pairs < 1000 && client.next(frame)) {
    pairs += frame.can_id == 417;
    if (frame.can_id != 418) continue;
    ++environments;
    EXPECT_NEAR((frame.data[0] | frame.data[1] << 8) * 0.01, 45, 20);   // % RH
    EXPECT_NEAR((frame.data[2] | frame.data[3] << 8) * 0.001, 5, 0.5);  // V
  }
  EXPECT_NEAR(environments, 100, 1);
}

TEST(WireCan, SeveralReceiversGetTheSameAndOneThatDoesNotReadHoldsNobodyUpForEver) {
  WireRig rig({}, 200);
  const std::string endpoint = rig.serve_can();
  FrameClient lazy(endpoint);
  FrameClient first(endpoint);
  FrameClient second(endpoint);
  // 3,000 samples are far more than the lazy one's socket buffer holds.
  expect_without_gap(read_samples(first, 3000));
  expect_without_gap(read_samples(second, 100));
}

TEST(WireCan, ReceiverMayComeAndGo) {
  WireRig rig({}, 50);
  const std::string endpoint = rig.serve_can();
  for (int i = 0; i < 3; ++i) {
    FrameClient client(endpoint);
    expect_without_gap(read_samples(client, 20));
  }
}

TEST(WireCan, MotionOfTheHeadIsInTheSamples) {
  WireRig rig({}, 50);
  ModbusClient head(rig.serve_tcp());
  const std::string endpoint = rig.serve_can();
  const auto code_now = [&] {
    FrameClient client(endpoint);
    return read_samples(client, 1).front().code;
  };
  const PerAxis<std::int32_t> before = code_now();
  head.move(0x000, 900000, 1);
  EXPECT_TRUE(eventually([&] { return head.bit(0x000, 14); }));
  EXPECT_NE(before, code_now());
}

TEST(WireCan, LossShowsAsCounterGaps) {
  WireRig rig({.all = {{.kind = FaultKind::can_loss, .count = 0, .probability = 0.1}}}, 100);
  FrameClient client(rig.serve_can());
  int seen = 0;
  int counted = 0;
  int last = -1;
  can_frame frame{};
  while (counted < 5000 && client.next(frame)) {
    if (frame.can_id != 416) continue;
    ++seen;
    if (last >= 0) counted += (frame.data[0] - last) & 0xFF;
    last = frame.data[0];
  }
  EXPECT_NEAR(seen, counted * 0.9, 5 * 21.2);  // √(5000·0.1·0.9)
}

TEST(WireCan, SocketIsRemovedAtTheEnd) {
  WireRig rig;
  const std::string path = rig.serve_can().substr(5);
  EXPECT_TRUE(std::filesystem::is_socket(path));
  rig.node.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(WireCan, WhatCannotBeHadIsRefusedInOneLine) {
  const TempFolder directory;
  for (const std::string& wrong : {std::string("tcp:1"), std::string("unix:"), std::string("can:"),
                                   "unix:" + std::string(200, 'x')}) {
    auto output = open_frame_output(wrong);
    ASSERT_FALSE(output.has_value()) << wrong;
    EXPECT_EQ(output.error().code, ErrorCode::input);
  }
  auto nowhere = open_frame_output("unix:" + directory.file("missing/can"));
  ASSERT_FALSE(nowhere.has_value());
  EXPECT_EQ(nowhere.error().code, ErrorCode::rig);
  auto no_interface = open_frame_output("can:nosuchcan0");
  ASSERT_FALSE(no_interface.has_value());
  EXPECT_EQ(no_interface.error().code, ErrorCode::rig);
  EXPECT_THAT(no_interface.error().message, HasSubstr("can:nosuchcan0"));
}

}  // namespace
}  // namespace plumbline::sim
