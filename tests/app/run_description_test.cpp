#include "app/config/run_description.h"

#include <gtest/gtest.h>

namespace plumbline::app {
namespace {

constexpr const char* kComplete = R"(
[dut]
serial = "A-0017"
model  = "triad"
[gravity]
local_mps2 = 9.8101
u_mps2     = 0.00002
[adc]
bits = 12
min_V = -5.0
max_V = 0.0
[temperature]
reference_C = 21.5
[grid]
delta_deg = { start = 0, stop = 350, step = 10 }
h_deg     = { start = 0, stop = 80,  step = 20 }
[angles]
u_delta_arcsec = 5.0
u_h_arcsec     = 4.0
[limits]
max_abs_error_mps2 = 0.2
)";

std::string message_of(const std::string& text) {
  const auto description = parse_run_description(text, "run.toml");
  return description ? "" : description.error().message;
}

TEST(RunDescription, ReadsEveryKey) {
  const auto run = parse_run_description(kComplete, "run.toml");
  ASSERT_TRUE(run) << run.error().message;
  EXPECT_EQ(run->dut.serial, "A-0017");
  EXPECT_EQ(run->dut.model, "triad");
  EXPECT_DOUBLE_EQ(run->gravity.local_mps2, 9.8101);
  EXPECT_DOUBLE_EQ(run->gravity.u_mps2, 0.00002);
  ASSERT_TRUE(run->adc);
  EXPECT_EQ(run->adc->bits, 12);
  EXPECT_DOUBLE_EQ(run->adc->lsb_V(), 5.0 / 4096);
  EXPECT_DOUBLE_EQ(run->reference_C, 21.5);
  EXPECT_DOUBLE_EQ(run->grid.delta.stop_deg, 350);
  EXPECT_DOUBLE_EQ(run->grid.h.step_deg, 20);
  EXPECT_DOUBLE_EQ(run->angles.delta_arcsec, 5);
  EXPECT_DOUBLE_EQ(run->angles.h_arcsec, 4);
  ASSERT_TRUE(run->limits);
  EXPECT_DOUBLE_EQ(run->limits->max_abs_error_mps2, 0.2);
}

TEST(RunDescription, WhatIsNotSaidIsNotAssumed) {
  const auto run = parse_run_description("[gravity]\nlocal_mps2 = 9.81\n", "run.toml");
  ASSERT_TRUE(run) << run.error().message;
  EXPECT_FALSE(run->adc);
  EXPECT_FALSE(run->limits);
  EXPECT_EQ(run->angles.delta_arcsec, 0);
  EXPECT_EQ(run->reference_C, 20.0);
}

struct Refusal {
  const char* name;
  std::string text;
  std::string message;

  friend std::ostream& operator<<(std::ostream& stream, const Refusal& refusal) {
    return stream << refusal.name;
  }
};

class RefusedDescription : public testing::TestWithParam<Refusal> {};

TEST_P(RefusedDescription, SaysWhereAndWhy) {
  EXPECT_EQ(message_of(GetParam().text), GetParam().message);
}

const std::string kGravity = "[gravity]\nlocal_mps2 = 9.81\n";

INSTANTIATE_TEST_SUITE_P(
    All, RefusedDescription,
    testing::Values(
        Refusal{"UnknownKey", "[gravity]\nlocal_mps = 9.81\n",
                "run.toml:2:1: unknown key gravity.local_mps; did you mean local_mps2?"},
        Refusal{"UnknownTable", kGravity + "[limit]\nmax_abs_error_mps2 = 1\n",
                "run.toml:3:2: unknown key limit; did you mean limits?"},
        Refusal{"NoGravity", "[dut]\nserial = \"a\"\n",
                "run.toml: [gravity] lacks the key local_mps2"},
        Refusal{"GravityOfNoPlaceOnEarth", "[gravity]\nlocal_mps2 = 98.1\n",
                "run.toml:2:14: gravity.local_mps2 = 98.1 is out of range (9.7 … 9.9)"},
        Refusal{"NegativeUncertainty", "[gravity]\nlocal_mps2 = 9.81\nu_mps2 = -1e-5\n",
                "run.toml:3:10: gravity.u_mps2 = -1e-05 is out of range (0 … 0.1)"},
        Refusal{"NegativeAngleUncertainty", kGravity + "[angles]\nu_h_arcsec = -5\n",
                "run.toml:4:14: angles.u_h_arcsec = -5 is out of range (0 … 36000)"},
        Refusal{"EmptyConverterSpan", kGravity + "[adc]\nbits = 12\nmin_V = 5\nmax_V = 5\n",
                "run.toml:5:9: adc.min_V: 5 is not below max_V = 5"},
        Refusal{"TooManyBits", kGravity + "[adc]\nbits = 64\nmin_V = -5\nmax_V = 5\n",
                "run.toml:4:8: adc.bits = 64 is out of range (4 … 32)"},
        Refusal{"HalfAConverter", kGravity + "[adc]\nbits = 12\n",
                "run.toml:3:1: [adc] lacks the key min_V"},
        Refusal{"StepZero", kGravity + "[grid]\ndelta_deg = { start = 0, stop = 350, step = 0 }\n",
                "run.toml:4:45: grid.delta_deg.step: must not be 0"},
        Refusal{"StepAway", kGravity + "[grid]\nh_deg = { start = 0, stop = 80, step = -10 }\n",
                "run.toml:4:40: grid.h_deg.step: -10 leads away from stop = 80"},
        Refusal{"StepPast", kGravity + "[grid]\nh_deg = { start = 0, stop = 80, step = 15 }\n",
                "run.toml:4:40: grid.h_deg.step: 15 from start = 0 does not reach stop = 80"},
        Refusal{"StepTiny", kGravity + "[grid]\nh_deg = { start = 0, stop = 80, step = 1e-9 }\n",
                "run.toml:4:40: grid.h_deg.step: 1e-09 makes more than 36000 positions"},
        Refusal{"TiltBeyondThePlumbLine",
                kGravity + "[grid]\nh_deg = { start = 0, stop = 100, step = 10 }\n",
                "run.toml:4:29: grid.h_deg.stop = 100 is out of range (-90 … 90)"},
        Refusal{"LimitZero", kGravity + "[limits]\nmax_abs_error_mps2 = 0\n",
                "run.toml:4:22: limits.max_abs_error_mps2: must be above 0; leave [limits] out for "
                "no limit"},
        Refusal{"NotToml", "[gravity\n",
                "run.toml:1:9: Error while parsing table header: expected ']', saw '\\n'"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(RunDescription, MissingFileIsNamed) {
  const auto run = read_run_description("/nonexistent/run.toml");
  ASSERT_FALSE(run);
  EXPECT_EQ(run.error().code, ErrorCode::input);
  EXPECT_EQ(run.error().message, "/nonexistent/run.toml: No such file or directory");
}

}  // namespace
}  // namespace plumbline::app
