// Samples that must not be accepted, and poses that have changed.
#include "app/sequencer/sample_guard.h"

#include <gmock/gmock.h>

namespace plumbline::app {
namespace {

using testing::HasSubstr;

constexpr Adc kAdc{.bits = 12, .min_V = -5, .max_V = 0};

std::vector<RawSample> noisy(std::size_t count) {
  std::vector<RawSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto wobble = static_cast<std::int32_t>(i % 3);
    samples[i].code = {100 + wobble, -200 - wobble, 7 + wobble};
  }
  return samples;
}

NoiseFloor floor_of(double sd_in_steps) {
  NoiseFloor floor;
  floor.sd_V.fill(sd_in_steps * kAdc.lsb_V());
  return floor;
}

TEST(SampleGuard, AcceptsWhatAConverterGives) {
  EXPECT_FALSE(implausible(noisy(40), kAdc, floor_of(1)));
  EXPECT_FALSE(implausible(noisy(40), kAdc, std::nullopt));
}

TEST(SampleGuard, RefusesBothEndsOfTheSpan) {
  auto samples = noisy(40);
  samples[39].code[1] = 2047;
  EXPECT_THAT(implausible(samples, kAdc, std::nullopt).value_or(""),
              HasSubstr("output y is at the end"));
  samples[39].code[1] = -2048;
  EXPECT_THAT(implausible(samples, kAdc, std::nullopt).value_or(""),
              HasSubstr("output y is at the end"));
  samples[39].code[1] = -2047;
  EXPECT_FALSE(implausible(samples, kAdc, std::nullopt));
}

TEST(SampleGuard, RefusesAConstantCodeWhereThereMustBeNoise) {
  auto samples = noisy(40);
  for (RawSample& sample : samples) sample.code[2] = 7;
  EXPECT_THAT(implausible(samples, kAdc, floor_of(1)).value_or(""), HasSubstr("output z"));
  // Rounding hides little noise, and a few samples may agree by chance.
  EXPECT_FALSE(implausible(samples, kAdc, floor_of(0.5)));
  EXPECT_FALSE(implausible(samples, kAdc, std::nullopt));
  samples.resize(11);
  EXPECT_FALSE(implausible(samples, kAdc, floor_of(1)));
}

TEST(SampleGuard, MeanAndScatterOfAPose) {
  storage::PoseRecord pose;
  pose.samples = noisy(3);  // codes 100, 101, 102 on x
  for (RawSample& sample : pose.samples) sample.temp_C = 21;
  const PoseMean mean = mean_of(pose, 5, kAdc);
  EXPECT_EQ(mean.step, 5);
  EXPECT_EQ(mean.samples, 3u);
  EXPECT_NEAR(mean.mean_V[0], kAdc.volts(101), 1e-12);
  EXPECT_NEAR(mean.sd_V[0], kAdc.lsb_V(), 1e-12);
  EXPECT_NEAR(mean.temp_C, 21, 1e-12);
}

TEST(SampleGuard, APoseMayDifferByNoiseStepsAndTolerance) {
  PoseMean before;
  before.samples = 100;
  before.sd_V.fill(1e-3);
  PoseMean now = before;
  const PerAxis<double> span_V = {0.06, 0.06, 0.06};
  // 0.001·0.06 V + 6·1 mV·√(2/100) + 2·1.2207 mV = 3.350 mV
  now.mean_V = {0, 0, 3.34e-3};
  EXPECT_FALSE(disagreement(before, now, span_V, 0.001, kAdc));
  now.mean_V = {0, 0, -3.36e-3};
  const auto why = disagreement(before, now, span_V, 0.001, kAdc);
  ASSERT_TRUE(why);
  EXPECT_THAT(*why, HasSubstr("on z"));
}

}  // namespace
}  // namespace plumbline::app
