// The head's geometry against numbers worked out by hand from the frames' definitions.
#include "rig/sim/head_errors.h"

#include <gtest/gtest.h>

#include <cmath>

namespace plumbline::sim {
namespace {

void expect_direction(const std::array<double, 3>& got, const std::array<double, 3>& wanted) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(got[i], wanted[i], 1e-9) << "component " << i;
}

TEST(HeadErrors, IdealHeadFollowsTheDefinitionOfTheFrames) {
  expect_direction(attitude({}, 0, 0).up, {1, 0, 0});
  expect_direction(attitude({}, 90, 0).up, {0, -1, 0});
  expect_direction(attitude({}, 0, 90).up, {0, 0, 1});
  // (cos 30°·cos 60°, −cos 30°·sin 60°, sin 30°)
  expect_direction(attitude({}, 60, 30).up, {0.4330127019, -0.75, 0.5});
}

TEST(HeadErrors, BaseAxesAreSeenInTheSensorFrame) {
  // At δ = h = 0: z_s = x_b, y_s = −y_b.
  expect_direction(attitude({}, 0, 0).base_x, {0, 0, 1});
  expect_direction(attitude({}, 0, 0).base_y, {0, -1, 0});
  expect_direction(attitude({}, 60, 30).base_x, {-0.25, 0.4330127019, 0.8660254038});
  expect_direction(attitude({}, 60, 30).base_y, {-0.8660254038, -0.5, 0});
}

TEST(HeadErrors, RollAndSkewBringInTheSidewaysComponent) {
  // Roll ε: a_x = cos δ·cos h·cos ε − sin δ·sin ε, a_y = −sin δ·cos h·cos ε − cos δ·sin ε.
  expect_direction(attitude({.base_roll_deg = 1}, 60, 30).up,
                   {0.4178325246, -0.7586119746, 0.4999238476});
  // Skew η: a_x = cos δ·cos h + sin δ·sin η·sin h, a_z = cos η·sin h.
  expect_direction(attitude({.axis_skew_deg = 1}, 60, 30).up,
                   {0.4405698156, -0.7456368984, 0.4999238476});
  // At h = 0 the skew cannot be seen.
  expect_direction(attitude({.axis_skew_deg = 1}, 60, 0).up, {0.5, -0.8660254038, 0});
}

TEST(HeadErrors, PitchOfTheBaseRaisesTheSpindleLikeATiltIndex) {
  expect_direction(attitude({.base_pitch_deg = 1}, 60, 30).up, attitude({}, 60, 31).up);
  expect_direction(attitude({.h_index_deg = 1}, 60, 30).up,
                   {0.4285836504, -0.7423286577, 0.5150380749});
}

TEST(HeadErrors, ErrorsOfTheSpindle) {
  expect_direction(attitude({.delta_index_deg = 1}, 60, 30).up, attitude({}, 61, 30).up);
  // 60° + cos 60° + ½ sin 60°, 60° + cos 120° + ½ sin 120°
  expect_direction(
      attitude({.delta_eccentricity_c_deg = 1, .delta_eccentricity_s_deg = 0.5}, 60, 30).up,
      {0.4207427235, -0.7569514916, 0.5});
  expect_direction(
      attitude({.delta_ellipticity_c_deg = 1, .delta_ellipticity_s_deg = 0.5}, 60, 30).up,
      {0.4338892674, -0.7494932312, 0.5});
}

TEST(HeadErrors, BacklashDependsOnTheApproach) {
  const HeadErrors errors{.backlash_deg = 2};
  expect_direction(attitude(errors, 60, 30, +1).up, {0.4198574471, -0.7574428850, 0.5});
  expect_direction(attitude(errors, 60, 30, -1).up, {0.4460360568, -0.7423286577, 0.5});
  expect_direction(attitude(errors, 60, 30, 0).up, attitude({}, 60, 30).up);
}

TEST(HeadErrors, ErrorsOfTheTilt) {
  expect_direction(attitude({.h_scale = 0.02}, 60, 30).up,
                   {0.4303710135, -0.7454244615, 0.5090414158});
  // 30° + cos 30° + ½ sin 30°
  expect_direction(attitude({.h_eccentricity_c_deg = 1, .h_eccentricity_s_deg = 0.5}, 60, 30).up,
                   {0.4280612894, -0.7414239020, 0.5167728032});
}

TEST(HeadErrors, DirectionsStayOrthonormalUnderAllErrorsTogether) {
  const HeadErrors all{1, -2, 3, 4, -5, 1, 2, -3, 1, 0.1, 2, -1, 2};
  const Attitude seen = attitude(all, 123, 45, -1);
  const auto dot = [](const auto& a, const auto& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  EXPECT_NEAR(dot(seen.up, seen.up), 1, 1e-12);
  EXPECT_NEAR(dot(seen.base_x, seen.base_y), 0, 1e-12);
  EXPECT_NEAR(dot(seen.base_x, seen.base_x), 1, 1e-12);
}

}  // namespace
}  // namespace plumbline::sim
