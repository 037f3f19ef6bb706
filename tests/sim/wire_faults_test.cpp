// When a fault of the world file acts, and what its reader refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "rig/sim/drive_settings.h"
#include "rig/sim/faults.h"
#include "rig/sim/world.h"

namespace plumbline::sim {
namespace {

Result<Faults> parse(const std::string& text) {
  auto file = rig::StrictFile::parse(text, "world.toml");
  if (!file) return fail(file.error());
  Faults faults = read_faults(file->root());
  if (auto done = file->finish(); !done) return fail(done.error());
  return faults;
}

/// Which of the first `events` events, 1 s apart, the single fault of `text` acts on.
std::vector<int> acting_events(const std::string& text, int events, std::int64_t moves = 0,
                               std::uint64_t seed = 1) {
  const Faults faults = parse(text).value();
  FaultInjector injector(faults, stage_of(faults.all.at(0).kind), seed);
  std::vector<int> acting;
  for (int i = 0; i < events; ++i) {
    if (!injector.event(i, moves).empty()) acting.push_back(i);
  }
  return acting;
}

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(WireFaults, BareTriggersActOnce) {
  EXPECT_THAT(acting_events("[[faults]]\nkind='modbus.silence'\nafter=3", 10), ElementsAre(3));
  EXPECT_THAT(acting_events("[[faults]]\nkind='modbus.silence'\nat_s=4.5", 10), ElementsAre(5));
  EXPECT_THAT(acting_events("[[faults]]\nkind='modbus.silence'\nmove=1", 10, 1), IsEmpty());
  EXPECT_THAT(acting_events("[[faults]]\nkind='modbus.silence'\nmove=1", 10, 2), ElementsAre(0));
}

TEST(WireFaults, CountDelayAndDurationBoundIt) {
  EXPECT_THAT(acting_events("[[faults]]\nkind='modbus.silence'\nafter=3\ncount=2", 10),
              ElementsAre(3, 4));
  EXPECT_THAT(acting_events("[[faults]]\nkind='can.silence'\nat_s=2\ndelay_s=1\nduration_s=3", 10),
              ElementsAre(3, 4, 5));
  EXPECT_THAT(acting_events("[[faults]]\nkind='can.silence'\nat_s=2\nduration_s=3\ncount=1", 10),
              ElementsAre(2));
}

TEST(WireFaults, ProbabilityIsARateThatTheSeedRepeats) {
  const std::string text = "[[faults]]\nkind='can.loss'\nprobability=0.05";
  const auto first = acting_events(text, 10000, 0, 7);
  EXPECT_NEAR(static_cast<double>(first.size()), 500, 5 * 21.8);  // √(10⁴·0.05·0.95) = 21.8
  EXPECT_EQ(first, acting_events(text, 10000, 0, 7));
  EXPECT_NE(first, acting_events(text, 10000, 0, 8));
}

TEST(WireFaults, PassingTimeTriggersWithoutAnEvent) {
  const Faults faults =
      parse("[[faults]]\nkind='drive.slip'\nslip_deg=0.3\nmove=0\ndelay_s=0.2\naxis='h'").value();
  FaultInjector injector(faults, FaultStage::drive, 1);
  EXPECT_TRUE(injector.passing(0.0, 0).empty());
  EXPECT_TRUE(injector.event(1.0, 1).empty());
  EXPECT_TRUE(injector.passing(1.1, 1).empty());
  const auto acting = injector.passing(1.3, 1);
  ASSERT_EQ(acting.size(), 1u);
  EXPECT_EQ(acting[0]->axis, 1);
  EXPECT_DOUBLE_EQ(acting[0]->value, 0.3);
  EXPECT_TRUE(injector.passing(1.4, 1).empty());
}

TEST(WireFaults, OtherStagesAreLeftAlone) {
  const Faults faults = parse("[[faults]]\nkind='can.loss'").value();
  FaultInjector injector(faults, FaultStage::modbus, 1);
  EXPECT_TRUE(injector.event(0, 0).empty());
}

TEST(WireFaults, WrongEntriesAreRefusedByName) {
  EXPECT_THAT(parse("[[faults]]\nkind='modbus.silense'").error().message,
              HasSubstr("modbus.silence"));
  EXPECT_THAT(parse("[[faults]]\n").error().message, HasSubstr("kind"));
  EXPECT_THAT(parse("[[faults]]\nkind='can.loss'\nat_s=1\nmove=2").error().message,
              HasSubstr("more than one of"));
  EXPECT_THAT(parse("[[faults]]\nkind='can.loss'\nslip_deg=1").error().message,
              HasSubstr("slip_deg"));
  EXPECT_THAT(parse("[[faults]]\nkind='modbus.exception'\ncode=12").error().message,
              HasSubstr("world.toml:3"));
}

TEST(WireFaults, ReadyMadeWorldsShowEveryKind) {
  std::set<FaultKind> kinds;
  for (const char* name : {"faulty-bus.toml", "faulty-drive.toml"}) {
    auto world = read_world(std::string(PLUMBLINE_SOURCE_DIR "/rig/sim/worlds/") + name);
    ASSERT_TRUE(world.has_value()) << world.error().message;
    for (const Fault& fault : world->faults.all) kinds.insert(fault.kind);
  }
  for (int kind = 0; kind <= static_cast<int>(FaultKind::can_duplicate); ++kind) {
    EXPECT_TRUE(kinds.contains(static_cast<FaultKind>(kind))) << "kind " << kind;
  }
}

TEST(WireFaults, DriveSettingsAreRead) {
  auto file = rig::StrictFile::parse(
      "unit_id = 7\nword_order = 'low_first'\ncounts_per_deg = 3600\n"
      "[h]\nspeed_deg_s = 12\nupper_limit_deg = 85\n",
      "world.toml");
  const DriveSettings drive = read_drive(file->root());
  ASSERT_TRUE(file->finish().has_value());
  EXPECT_EQ(drive.unit_id, 7);
  EXPECT_FALSE(drive.high_word_first);
  EXPECT_EQ(drive.counts_per_deg[1], 3600);
  EXPECT_EQ(drive.axis[0].speed_deg_s, 30);
  EXPECT_EQ(drive.axis[1].speed_deg_s, 12);
  EXPECT_EQ(drive.axis[1].upper_limit_deg, 85);
}

}  // namespace
}  // namespace plumbline::sim
