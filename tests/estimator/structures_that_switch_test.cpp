// What has no name and switches to and fro between two levels, by no rule.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

/// Of a run from 61 s on with a pose every 3 s, all between two poses.
const std::vector<double> kTimes_s = {95.7, 152.6, 179.5, 191.6, 317.7, 437.5, 512.3};

double telegraph(double t_s) {
  const auto switches = std::upper_bound(kTimes_s.begin(), kTimes_s.end(), t_s) - kTimes_s.begin();
  return switches % 2 == 0 ? 0 : 1;
}

/// `unsettled`: the switch beside a pose that does not show on which side of it the switch was.
void expect_telegraph(SyntheticOptions options, const char* form, const std::string& added_to,
                      double size, std::optional<std::size_t> unsettled = {}) {
  options.delta_step_deg = 10;
  options.random_order = true;
  const std::string shape = "two levels, from one to the other 7 times" + added_to;
  const UnlistedStructure found = expect_only_structure(options, {"t_s", form, shape.c_str()});
  if (found.parameters.size() != kTimes_s.size() + 1) return;  // it has failed already
  for (std::size_t k = 0; k < kTimes_s.size(); ++k) {
    constexpr double kHalfWay_s = 1.5, kPose_s = 3;
    EXPECT_NEAR(found.parameters[k].value, kTimes_s[k], kHalfWay_s + (k == unsettled ? kPose_s : 0))
        << k;
    EXPECT_GT(found.parameters[k].u, 0);
  }
  EXPECT_NEAR(found.parameters.back().value, size, 4 * found.parameters.back().u);
}

// As steps of the bias, pulses and windows.
TEST(Structure, PopcornNoiseHasTwoLevels) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto&, double t_s) { return 0.02 * 0.032 * telegraph(t_s); };
  expect_telegraph(options, "bias", "", 0.02);
}

TEST(Structure, AGainThatSwitchesHasTwoLevels) {
  SyntheticOptions options;
  options.more_V[0] = [](const auto& a, double t_s) {
    return 0.04 * 0.032 * telegraph(t_s) * a[0];
  };
  expect_telegraph(options, "scale", "", 0.04, 0);  // the component is nothing at the pose at 94 s
}

// As slips of the index.
TEST(Structure, WhoStandsNowHereNowThereTiltsTheBaseToAndFro) {
  SyntheticOptions options;
  options.base_roll_rad = [](double t_s) { return 1.2 * std::numbers::pi / 180 * telegraph(t_s); };
  expect_telegraph(options, "geometry", ", added to the base roll", 1.2);
}

}  // namespace
}  // namespace plumbline
