// The drive's registers, commands, alarms, homing and watchdog, at exact times.
#include <gtest/gtest.h>

#include <initializer_list>
#include <vector>

#include "rig/sim/drive.h"
#include "tests/sim/wire_rig.h"

namespace plumbline::sim {
namespace {

using std::chrono::milliseconds;

/// A drive with a hand on its registers. Time is what the test says.
class WireDrive : public ::testing::Test {
 protected:
  void make(const Faults& faults = {}, DriveSettings settings = {}) {
    drive = std::make_unique<Drive>(settings, faults, 1);
    drive->advance(0);
  }
  void SetUp() override { make(); }

  void write(int address, std::vector<std::uint16_t> words) {
    ASSERT_EQ(Drive::check_write(address, words), Refusal::none);
    drive->write(address, words, now_s);
  }
  void pulse(int base, std::uint16_t bit) {
    write(base + 0x00, {bit});
    write(base + 0x00, {0});
  }
  /// Target in counts, 30 °/s, 60 °/s², absolute, sequence; then START.
  void move(int base, std::int32_t target, std::uint16_t sequence, std::uint16_t mode = 1) {
    const auto bits = static_cast<std::uint32_t>(target);
    write(base + 0x02,
          {static_cast<std::uint16_t>(bits >> 16), static_cast<std::uint16_t>(bits & 0xFFFF),
           0x0004, 0x93E0, 0x0009, 0x27C0, 0x0009, 0x27C0, mode, sequence});
    pulse(base, 1u << 3);
  }
  /// In steps of 10 ms, as the samples of a node would have it.
  void pass(double seconds) {
    const double until_s = now_s + seconds;
    while (now_s < until_s - 1e-9) {
      now_s = std::min(now_s + 0.01, until_s);
      drive->advance(now_s);
    }
  }
  int read16(int address) {
    std::vector<std::uint16_t> all(kRegisterEnd);
    drive->image(now_s, all);
    return all.at(static_cast<std::size_t>(address));
  }
  std::int32_t read32(int address) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(read16(address)) << 16 |
                                     static_cast<std::uint32_t>(read16(address + 1)));
  }
  bool bit(int base, int number) { return ((read16(base + 0x20) >> number) & 1) != 0; }
  int alarm(int base) { return read16(base + 0x21); }

  std::unique_ptr<Drive> drive;
  double now_s = 0;
};

TEST_F(WireDrive, DeliveredState) {
  EXPECT_EQ(read32(kDelta + 0x04), 300000);    // 30 °/s
  EXPECT_EQ(read32(kDelta + 0x06), 600000);    // 60 °/s²
  EXPECT_EQ(read32(kDelta + 0x12), -3690000);  // 1° inside the switches at ±370°
  EXPECT_EQ(read32(kTilt + 0x14), 940000);
  EXPECT_EQ(read16(kDelta + 0x20), 1 << 0 | 1 << 5 | 1 << 14);  // ENABLED READY IN POSITION
  EXPECT_EQ(read16(kDelta + 0x2C), 280);
}

// 10° is a triangle of 0.8165 s, then 0.196 s to settle and 0.05 s to hold: 1.0625 s.
TEST_F(WireDrive, MoveEchoesAndArrives) {
  move(kDelta, 100000, 7);
  EXPECT_EQ(read32(kDelta + 0x26), 100000);
  EXPECT_EQ(read16(kDelta + 0x2A), 7);
  EXPECT_EQ(drive->moves(), 1);
  pass(0.4);
  EXPECT_TRUE(bit(kDelta, 8));
  EXPECT_TRUE(bit(kDelta, 13));
  EXPECT_FALSE(bit(kDelta, 14));
  EXPECT_FALSE(bit(kDelta, 5));
  EXPECT_EQ(read32(kDelta + 0x28), 240000);  // 60 °/s² · 0.4 s
  EXPECT_EQ(read32(kDelta + 0x24), 48000);   // ½ · 60 · 0.4²
  pass(0.65);
  EXPECT_FALSE(bit(kDelta, 13));
  EXPECT_FALSE(bit(kDelta, 14)) << "window not yet held";
  pass(0.02);
  EXPECT_TRUE(bit(kDelta, 14));
  EXPECT_TRUE(bit(kDelta, 5));
  EXPECT_NEAR(read32(kDelta + 0x22), 100000, 52);  // window 50 counts, encoder step 2.8
  EXPECT_EQ(read32(kTilt + 0x26), 0) << "the other axis is not concerned";
}

TEST_F(WireDrive, StartActsOnTheEdgeOnly) {
  write(kDelta + 0x02, {0, 50000});
  write(kDelta + 0x0B, {1});
  write(kDelta, {8});
  write(kDelta + 0x0B, {2});
  write(kDelta, {8});
  EXPECT_EQ(read16(kDelta + 0x2A), 1);
  write(kDelta, {0});
  write(kDelta, {8});
  EXPECT_EQ(read16(kDelta + 0x2A), 2);
}

TEST_F(WireDrive, CommandAndParametersInOneWrite) {
  write(kTilt, {8, 0, 0x0001, 0x86A0, 0x0004, 0x93E0, 0x0009, 0x27C0, 0x0009, 0x27C0, 1, 3});
  EXPECT_EQ(read32(kTilt + 0x26), 100000);
  pass(2);
  EXPECT_NEAR(read32(kTilt + 0x22), 100000, 52);
}

TEST_F(WireDrive, RelativeMovesAddUp) {
  move(kDelta, 20000, 1, 2);
  pass(2);
  move(kDelta, 20000, 2, 2);
  pass(2);
  EXPECT_NEAR(read32(kDelta + 0x22), 40000, 52);
}

// From 3° to the switch at −5°: ramps of 0.83° in 0.167 s each, the rest at 10 °/s: 0.9667 s.
// Back to 0: 5° in 0.6667 s. Together with settling well before 2.2 s.
TEST_F(WireDrive, HomingFindsZeroAndSaysSo) {
  EXPECT_FALSE(bit(kDelta, 4));
  EXPECT_DOUBLE_EQ(drive->head(0).delta.angle_deg, 3.0);
  pulse(kDelta, 1u << 4);
  pass(0.95);
  EXPECT_TRUE(bit(kDelta, 8));
  EXPECT_NEAR(drive->head(now_s).delta.angle_deg, -5.0, 0.05);
  pass(0.7);
  EXPECT_FALSE(bit(kDelta, 4)) << "not before it has settled";
  pass(0.55);
  EXPECT_TRUE(bit(kDelta, 4));
  EXPECT_FALSE(bit(kDelta, 8));
  EXPECT_NEAR(drive->head(now_s).delta.angle_deg, 0.0, 0.005);
  EXPECT_NEAR(read32(kDelta + 0x22), 0, 52);
}

TEST_F(WireDrive, StopInterruptsHoming) {
  pulse(kDelta, 1u << 4);
  pass(0.5);
  pulse(kDelta, 1u << 5);
  pass(5);
  EXPECT_FALSE(bit(kDelta, 4));
  EXPECT_FALSE(bit(kDelta, 8));
}

TEST_F(WireDrive, SoftLimitRefusesWithAlarm66) {
  pulse(kTilt, 1u << 4);
  pass(5);
  move(kTilt, 940000, 1);
  EXPECT_EQ(alarm(kTilt), 0);
  pass(5);
  move(kTilt, 940001, 2);
  EXPECT_EQ(alarm(kTilt), 0x66);
  EXPECT_TRUE(bit(kTilt, 7));
  EXPECT_EQ(read16(kTilt + 0x2A), 1) << "the echo is that of the last command taken";
  move(kTilt, 0, 3);
  EXPECT_EQ(read16(kTilt + 0x2A), 1) << "nothing starts under an alarm";
  EXPECT_TRUE(bit(kTilt, 6));
  pulse(kTilt, 1u << 7);
  EXPECT_EQ(alarm(kTilt), 0);
  EXPECT_FALSE(bit(kTilt, 6));
  move(kTilt, 0, 4);
  pass(5);
  EXPECT_TRUE(bit(kTilt, 14));
}

TEST_F(WireDrive, StopDeceleratesAndIsNotInPosition) {
  move(kDelta, 900000, 1);
  pass(1);
  pulse(kDelta, 1u << 5);
  EXPECT_TRUE(bit(kDelta, 13));
  pass(3);
  EXPECT_FALSE(bit(kDelta, 13));
  EXPECT_FALSE(bit(kDelta, 14));
  EXPECT_NEAR(read32(kDelta + 0x22), 300000, 60);
  EXPECT_TRUE(bit(kDelta, 5));
}

TEST_F(WireDrive, FreeDisablesUntilReset) {
  pulse(kDelta, 1u << 6);
  EXPECT_FALSE(bit(kDelta, 0));
  move(kDelta, 100000, 1);
  EXPECT_EQ(read16(kDelta + 0x2A), 0);
  pulse(kDelta, 1u << 7);
  EXPECT_TRUE(bit(kDelta, 0));
  move(kDelta, 100000, 2);
  EXPECT_EQ(read16(kDelta + 0x2A), 2);
}

TEST_F(WireDrive, JogRunsWhileItsBitIsSet) {
  write(kDelta, {1u << 12});
  pass(1);
  EXPECT_NEAR(read32(kDelta + 0x22), 225000, 10);
  write(kDelta, {0});
  pass(2);
  EXPECT_NEAR(read32(kDelta + 0x22), 300000, 60);
  write(kDelta, {1u << 13});
  pass(60);
  EXPECT_NEAR(read32(kDelta + 0x22), -3690000, 60) << "ends at the soft limit";
}

TEST_F(WireDrive, WatchdogGoesByTheHostsClock) {
  const Drive::HostTime start{};
  write(kDelta + 0x10, {500});
  drive->note_request(start);
  move(kDelta, 900000, 1);
  pass(1);
  drive->check_watchdog(now_s, start + milliseconds(500));
  EXPECT_EQ(alarm(kDelta), 0);
  drive->check_watchdog(now_s, start + milliseconds(501));
  EXPECT_EQ(alarm(kDelta), 0x84);
  EXPECT_EQ(alarm(kTilt), 0) << "its watchdog is off";
  pass(3);
  EXPECT_NEAR(read32(kDelta + 0x22), 300000, 60) << "stopped, from 22.5° at 30 °/s";
}

TEST_F(WireDrive, LimitSwitchTripsBeyondWidenedSoftLimits) {
  write(kTilt + 0x14, {0x000F, 0x4240});  // 100°
  move(kTilt, 990000, 1);
  pass(10);
  EXPECT_EQ(alarm(kTilt), 0x60);
  EXPECT_TRUE(bit(kTilt, 1));
  EXPECT_FALSE(bit(kTilt, 2));
  pulse(kTilt, 1u << 7);
  move(kTilt, 0, 2);
  pass(10);
  EXPECT_EQ(alarm(kTilt), 0) << "may leave its switch";
  EXPECT_TRUE(bit(kTilt, 14));
}

TEST_F(WireDrive, HeartbeatCountsRequests) {
  const int before = read16(kDelta + 0x2B);
  drive->note_request({});
  drive->note_request({});
  EXPECT_EQ(read16(kDelta + 0x2B), before + 2);
}

// Continuous motion for one time constant of 300 s: 8 K·(1 − 1/e) = 5.06 K.
TEST_F(WireDrive, MotionWarmsTheDrive) {
  write(kDelta + 0x04, {0, 10000});  // 1 °/s
  write(kDelta + 0x02, {0x002D, 0xC6C0});
  pulse(kDelta, 1u << 3);
  pass(300);
  EXPECT_NEAR(read16(kDelta + 0x2C), 280 + 51, 1);
  EXPECT_EQ(read16(kTilt + 0x2C), 280);
}

TEST_F(WireDrive, AddressesAndValues) {
  EXPECT_EQ(Drive::check_read(0x00, 0x2D), Refusal::none);
  EXPECT_EQ(Drive::check_read(0x00, 0x2E), Refusal::illegal_address);
  EXPECT_EQ(Drive::check_read(0x2D, 1), Refusal::illegal_address);
  EXPECT_EQ(Drive::check_read(0x120, 0x0D), Refusal::none);
  EXPECT_EQ(Drive::check_read(0x200, 4), Refusal::none) << "the nameplate";
  EXPECT_EQ(Drive::check_read(0x200, 5), Refusal::illegal_address);
  EXPECT_EQ(Drive::check_read(0x1FF, 1), Refusal::illegal_address);
  const auto ones = [](std::size_t n) { return std::vector<std::uint16_t>(n, 1); };
  EXPECT_EQ(Drive::check_write(0x00, ones(12)), Refusal::none);
  EXPECT_EQ(Drive::check_write(0x00, ones(13)), Refusal::illegal_address);
  EXPECT_EQ(Drive::check_write(0x0C, ones(1)), Refusal::illegal_address);
  EXPECT_EQ(Drive::check_write(0x110, ones(6)), Refusal::none);
  EXPECT_EQ(Drive::check_write(0x120, ones(1)), Refusal::illegal_address);
  EXPECT_EQ(Drive::check_write(0x0A, std::vector<std::uint16_t>{3}), Refusal::illegal_value);
}

TEST_F(WireDrive, LowWordFirst) {
  DriveSettings settings;
  settings.high_word_first = false;
  make({}, settings);
  EXPECT_EQ(read16(kDelta + 0x04), 0x93E0);
  EXPECT_EQ(read16(kDelta + 0x05), 0x0004);
  write(kDelta + 0x02, {0x86A0, 0x0001});
  pulse(kDelta, 1u << 3);
  pass(2);
  EXPECT_NEAR(drive->head(now_s).delta.encoder_deg, 10.0, 0.006);
}

// Stalled 0.5 s into a move of 90°, at 7.5° and 30 °/s: half a degree behind 1/60 s later.
TEST_F(WireDrive, StallEndsInFollowingError) {
  make({.all = {{.kind = FaultKind::drive_stall, .move = 0, .delay_s = 0.5}}});
  move(kDelta, 900000, 1);
  pass(0.51);
  EXPECT_EQ(alarm(kDelta), 0);
  EXPECT_TRUE(bit(kDelta, 15));
  pass(0.03);
  EXPECT_EQ(alarm(kDelta), 0x10);
  EXPECT_TRUE(bit(kDelta, 3));
  EXPECT_FALSE(bit(kDelta, 13));
  EXPECT_NEAR(read32(kDelta + 0x22), 75000, 3100);
  pulse(kDelta, 1u << 7);
  move(kDelta, 900000, 2);
  pass(5);
  EXPECT_TRUE(bit(kDelta, 14)) << "the fault was for the first move only";
}

TEST_F(WireDrive, SlipMovesTheShaftButNotTheEncoder) {
  make({.all = {{.kind = FaultKind::drive_slip, .move = 1, .value = 0.5}}});
  const double offset = drive->head(0).delta.angle_deg;
  move(kDelta, 100000, 1);
  pass(3);
  EXPECT_NEAR(drive->head(now_s).delta.angle_deg, 10.0 + offset, 0.005);
  move(kDelta, 200000, 2);
  pass(3);
  EXPECT_NEAR(drive->head(now_s).delta.angle_deg, 19.5 + offset, 0.005);
  EXPECT_NEAR(drive->head(now_s).delta.encoder_deg, 20.0, 0.006);
}

TEST_F(WireDrive, OtherDriveFaults) {
  make({.all = {{.kind = FaultKind::drive_alarm, .at_s = 1, .axis = 1, .value = 0x28},
                {.kind = FaultKind::drive_lost_homing, .at_s = 8},
                {.kind = FaultKind::drive_limit, .at_s = 9}}});
  pass(1.1);
  EXPECT_EQ(alarm(kTilt), 0x28);
  pulse(kDelta, 1u << 4);
  pass(6);
  EXPECT_TRUE(bit(kDelta, 4));
  pass(1.1);
  EXPECT_FALSE(bit(kDelta, 4));
  pass(1);
  EXPECT_EQ(alarm(kDelta), 0x60);
  EXPECT_TRUE(bit(kDelta, 1));
}

}  // namespace
}  // namespace plumbline::sim
