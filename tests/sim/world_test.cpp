// World files: what is read, what is refused, and that the ready-made ones are right.
#include "rig/sim/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace plumbline::sim {
namespace {

using ::testing::HasSubstr;

std::string refusal(const std::string& text) {
  const auto world = parse_world(text, "w.toml");
  if (world) return "accepted";
  EXPECT_EQ(world.error().code, ErrorCode::input);
  return world.error().message;
}

TEST(World, EmptyFileIsTheUnitOfThePaperWithoutNoise) {
  const auto world = parse_world("", "w.toml");
  ASSERT_TRUE(world);
  EXPECT_DOUBLE_EQ(world->triad.K_V_per_g[0][0], 0.032002);
  EXPECT_DOUBLE_EQ(world->triad.K_V_per_g[2][2], -0.032812);
  EXPECT_DOUBLE_EQ(world->triad.U0_V[1], -2.4363);
  EXPECT_DOUBLE_EQ(world->noise_V[0].N, 0);
  EXPECT_TRUE(world->effects.empty());
}

TEST(World, NoiseMayBeGivenInVoltsOrInGAndPerAxis) {
  const auto world = parse_world(R"(
[unit]
K_z_V_per_g = [0, 0, -0.05]
[noise]
N = 1e-5
B = 2e-5
[noise.z]
unit = "g"
N = 1e-3
)",
                                 "w.toml");
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_DOUBLE_EQ(world->noise_V[0].N, 1e-5);
  EXPECT_DOUBLE_EQ(world->noise_V[2].N, 5e-5);
  EXPECT_DOUBLE_EQ(world->noise_V[2].B, 2e-5);
}

TEST(World, RefusesWithPlaceReasonAndHint) {
  EXPECT_THAT(refusal("[unt]\n"), HasSubstr("unknown key unt; did you mean unit?"));
  EXPECT_THAT(refusal("[[effects]]\nid = 'sensor.quadratc'\n"),
              HasSubstr("w.toml:2:6: effects.id: there is no effect \"sensor.quadratc\"; did you "
                        "mean \"sensor.quadratic\"?"));
  EXPECT_THAT(refusal("[[effects]]\nid = 'sensor.quadratic'\nk3 = 1\n"),
              HasSubstr("w.toml:3:1: unknown key effects.k3; did you mean k2?"));
  EXPECT_THAT(refusal("[[effects]]\nid = 'sensor.quadratic'\n"), HasSubstr("lacks the key k2"));
  EXPECT_THAT(refusal("[[effects]]\nid = 'sensor.drift'\nd = 1\naxes = ['w']\n"),
              HasSubstr("\"w\" is not an axis"));
  EXPECT_THAT(refusal("[[effects]]\nid = 'rig.base_roll'\nepsilon = 1\naxes = ['x']\n"),
              HasSubstr("unknown key effects.axes"));
  EXPECT_THAT(refusal("[[effects]]\nid = 'rig.pose_outlier'\n"), HasSubstr("at least one pose"));
  EXPECT_THAT(refusal("[adc]\nbits = 11\n"), HasSubstr("out of range"));
  EXPECT_THAT(refusal("[adc]\nmin_V = 1\nmax_V = 1\n"), HasSubstr("above min_V"));
  EXPECT_THAT(refusal("[noise]\nN = -1\n"), HasSubstr("out of range"));
  EXPECT_THAT(refusal("[unit]\nK_x_V_per_g = [0, 1, 0]\n"), HasSubstr("measure nothing"));
}

TEST(World, ReadyMadeWorldsAreRight) {
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(PLUMBLINE_SOURCE_DIR "/rig/sim/worlds")) {
    if (entry.path().extension() != ".toml") continue;
    ++files;
    const auto world = read_world(entry.path());
    EXPECT_TRUE(world) << (world ? "" : world.error().message);
  }
  EXPECT_GE(files, 3);
}

}  // namespace
}  // namespace plumbline::sim
