// What has no name and is there at some places of the head and not at others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

SyntheticOptions grid_of_the_rig() {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  return options;
}

// As sectors and bells of the bias.
TEST(Structure, ABadContactInPartOfTheTurnIsASectorOfTheScale) {
  SyntheticOptions options = grid_of_the_rig();
  options.more_V[0] = [](const auto& a_g, double) {
    const double at_deg = delta_deg_of(a_g);
    return at_deg > 95 && at_deg < 185 ? -5e-4 * a_g[0] : 0;
  };
  expect_only_structure(options, {"delta_deg", "scale", "sector"});
}

// As a bend and a step of the component along the spindle.
TEST(Structure, ACableThatPullsTightAboveATiltIsABendOfIt) {
  SyntheticOptions options = grid_of_the_rig();
  options.random_order = true;
  options.more_V[0] = [](const auto& a_g, double) {
    return 3e-5 * std::max(0.0, h_deg_of(a_g) - 50);
  };
  const UnlistedStructure found = expect_only_structure(options, {"h_deg", "bias", "bend"});
  EXPECT_NEAR(parameter(found, "at").value, 50 * kRadPerDeg, 3 * kRadPerDeg);
}

// As a bell of the turn and products of harmonics.
TEST(Structure, AMagnetBesideTheHeadIsASpot) {
  SyntheticOptions options = grid_of_the_rig();
  options.more_V[1] = [](const auto& a_g, double) {
    const double x = std::remainder(delta_deg_of(a_g) - 63, 360) / 25,
                 y = (h_deg_of(a_g) - 38) / 15;
    return 6e-4 * std::exp(-0.5 * (x * x + y * y));
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"delta_deg", "bias", "bell, times a bell of h_deg"});
  EXPECT_NEAR(parameter(found, "middle").value, 63 * kRadPerDeg, 4 * kRadPerDeg);
  EXPECT_NEAR(parameter(found, "other_middle").value, 38 * kRadPerDeg, 4 * kRadPerDeg);
}

// As products of the column with components, and periodic errors of delta.
TEST(Structure, LightThatFallsOnOneSideGoesByItsColumnThere) {
  SyntheticOptions options = grid_of_the_rig();
  const auto light = [](double t_s) { return 500 + 300 * std::sin(t_s / 70); };
  options.more_V[1] = [=](const auto& a_g, double t_s) {
    const double turned_rad = (delta_deg_of(a_g) - 67) * kRadPerDeg;
    return 1.2e-6 * light(t_s) * std::max(0.0, std::cos(turned_rad)) *
           std::cos(h_deg_of(a_g) * kRadPerDeg);
  };
  const UnlistedStructure found =
      expect_only_structure(with_column(options, "lux", light),
                            {"lux", "bias", "straight line, on one side of the turn"});
  EXPECT_NEAR(parameter(found, "middle").value, 67 * kRadPerDeg, 2 * kRadPerDeg);
}

// From the last pose on the index had slipped.
TEST(Findings, ALastPoseThatIsOffIsAPoseAtAWrongAngle) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double h_deg) {
    return delta_deg == 350 && h_deg == 80 ? 6.0 : 0;
  };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  ASSERT_THAT(result.diagnosis.effects, testing::SizeIs(1));
  EXPECT_EQ(result.diagnosis.effects[0].id, "rig.pose_outlier");
}

}  // namespace
}  // namespace plumbline
