#include "app/config/rig_description.h"

#include <gtest/gtest.h>

#include "app/config/run_description.h"

namespace plumbline::app {
namespace {

const std::string kRun = "[dut]\nserial = \"A\"\n[gravity]\nlocal_mps2 = 9.81\n";
const std::string kRig =
    "[head]\nmodbus = \"tcp:127.0.0.1:502\"\n[sensor]\ncan = \"can:can0\"\n"
    "bits = 12\nmin_V = -2.5\nmax_V = 2.5\n";

std::string refusal_of(const std::string& text) {
  const auto description = parse_rig_description(text, "rig.toml");
  return description ? "" : description.error().message;
}

TEST(RigDescription, ReadsTheRunTheRigAndThePlan) {
  const std::string text = kRun + kRig +
                           "[plan]\norder = \"random\"\none_sided = true\nsoak_s = 30\n"
                           "samples_per_pose = 25\nverification_poses = 12\nseed = 7\n"
                           "[settling]\nwindow = 30\ncap_s = 5\n";
  const auto rig = parse_rig_description(text, "rig.toml");
  ASSERT_TRUE(rig) << rig.error().message;
  EXPECT_EQ(rig->run.dut.serial, "A");
  EXPECT_EQ(rig->head.modbus, "tcp:127.0.0.1:502");
  EXPECT_EQ(rig->sensor.can, "can:can0");
  EXPECT_EQ(rig->plan.order, VisitOrder::random);
  EXPECT_TRUE(rig->plan.one_sided);
  EXPECT_EQ(rig->plan.soak_s, 30);
  EXPECT_EQ(rig->plan.samples_per_pose, 25);
  EXPECT_EQ(rig->plan.verification_poses, 12);
  EXPECT_EQ(rig->plan.seed, 7u);
  EXPECT_EQ(rig->settling.window, 30);
  EXPECT_EQ(rig->settling.cap_s, 5);
  EXPECT_EQ(rig->source, text);
}

TEST(RigDescription, TheConverterOfTheSensorIsThatOfTheRun) {
  const auto rig = parse_rig_description(kRun + kRig, "rig.toml");
  ASSERT_TRUE(rig) << rig.error().message;
  ASSERT_TRUE(rig->run.adc);
  EXPECT_EQ(rig->run.adc->bits, 12);
  EXPECT_DOUBLE_EQ(rig->run.adc->min_V, -2.5);
}

TEST(RigDescription, ServesAsADescriptionOfTheRun) {
  const auto run = parse_run_description(kRun + kRig, "rig.toml");
  ASSERT_TRUE(run) << run.error().message;
  EXPECT_EQ(run->dut.serial, "A");
  ASSERT_TRUE(run->adc);
  EXPECT_EQ(run->adc->bits, 12);
}

TEST(RigDescription, RefusesContradictions) {
  EXPECT_EQ(refusal_of(kRun + kRig + "[adc]\nbits = 16\nmin_V = -2.5\nmax_V = 2.5\n"),
            "rig.toml:12:1: adc: contradicts the converter of [sensor]; give it once");
  EXPECT_EQ(refusal_of(kRun + kRig + "[settling]\nhold_s = 3\ncap_s = 2\n"),
            "rig.toml:14:9: settling.cap_s: 2 is shorter than hold_s = 3");
  EXPECT_EQ(
      refusal_of(kRun + kRig + "[plan]\norder = \"sneak\"\n"),
      "rig.toml:13:9: plan.order = \"sneak\" is not one of raster, snake, spiral, random; did "
      "you mean \"snake\"?");
  EXPECT_EQ(refusal_of(kRun + kRig + "[plan]\nsample_per_pose = 3\n"),
            "rig.toml:13:1: unknown key plan.sample_per_pose; did you mean samples_per_pose?");
  EXPECT_EQ(refusal_of(kRun + kRig + "[plan]\nsamples_per_pose = 0\n"),
            "rig.toml:13:20: plan.samples_per_pose = 0 is out of range (1 … 1000000)");
}

}  // namespace
}  // namespace plumbline::app
