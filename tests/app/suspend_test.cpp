// Conditions under which a run waits: delay, hysteresis, hold.
#include "app/sequencer/suspend.h"

#include <gmock/gmock.h>

#include <cmath>

namespace plumbline::app {
namespace {

using testing::HasSubstr;

SuspendMonitor band() {
  return SuspendMonitor(
      {{.column = "temp_C", .min = 18, .max = 26, .hysteresis = 1, .delay_s = 5, .hold_s = 30}});
}

TEST(Suspend, AShortExcursionIsForgiven) {
  SuspendMonitor monitor = band();
  monitor.add("temp_C", 0, 27);
  monitor.add("temp_C", 4.9, 27);
  monitor.add("temp_C", 4.95, 25);
  monitor.add("temp_C", 5.1, 27);
  monitor.add("temp_C", 10.0, 27);
  EXPECT_FALSE(monitor.reason());
  monitor.add("temp_C", 10.1, 27.5);
  ASSERT_TRUE(monitor.reason());
  EXPECT_THAT(*monitor.reason(), HasSubstr("temp_C = 27.5 is outside 18 to 26"));
}

TEST(Suspend, GoesOnOnlyWellInsideAndForLong) {
  SuspendMonitor monitor = band();
  monitor.add("temp_C", 0, 17);
  monitor.add("temp_C", 5, 17);
  ASSERT_TRUE(monitor.reason());
  for (int t = 6; t < 100; ++t) monitor.add("temp_C", t, 18.9);  // inside the band, not its core
  EXPECT_TRUE(monitor.reason());
  monitor.add("temp_C", 100, 19);
  monitor.add("temp_C", 129, 19);
  EXPECT_TRUE(monitor.reason());
  monitor.add("temp_C", 129.5, 18.5);  // breaks the hold
  monitor.add("temp_C", 130, 22);
  monitor.add("temp_C", 159.9, 22);
  EXPECT_TRUE(monitor.reason());
  monitor.add("temp_C", 160, 22);
  EXPECT_FALSE(monitor.reason());
}

TEST(Suspend, AReadingThatIsNoneLiesInNoBand) {
  SuspendMonitor monitor = band();
  monitor.add("temp_C", 0, std::nan(""));
  monitor.add("temp_C", 5, std::nan(""));
  EXPECT_TRUE(monitor.reason());
}

TEST(Suspend, OtherColumnsDoNotCountAndEachConditionStandsForItself) {
  SuspendMonitor monitor({{.column = "supply_V", .min = 4.9, .delay_s = 0, .hold_s = 0},
                          {.column = "vibration", .max = 2, .delay_s = 0, .hold_s = 0}});
  EXPECT_TRUE(monitor.watches("vibration"));
  EXPECT_FALSE(monitor.watches("temp_C"));
  monitor.add("rh_pct", 0, -1);
  EXPECT_FALSE(monitor.reason());
  monitor.add("vibration", 1, 3);
  monitor.add("supply_V", 1, 4.8);
  EXPECT_THAT(*monitor.reason(), HasSubstr("supply_V"));
  monitor.add("supply_V", 2, 5);
  EXPECT_THAT(*monitor.reason(), HasSubstr("vibration = 3"));
  monitor.add("vibration", 3, 1);
  EXPECT_FALSE(monitor.reason());
}

}  // namespace
}  // namespace plumbline::app
