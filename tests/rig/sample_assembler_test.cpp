#include "rig/sample_assembler.h"

#include <gtest/gtest.h>

#include "tests/rig/node_messages.h"

namespace plumbline::rig {
namespace {

using Bytes = std::vector<std::uint8_t>;

class Assembler : public ::testing::Test {
 protected:
  void push(const CanFrame& frame, double expected = 0) {
    if (const auto sample = assembler.push(frame, expected)) samples.push_back(*sample);
  }
  void push(int counter) {
    const auto frames = sample_frames(counter, counter, 2, 3);
    push(frames.a);
    push(frames.b);
  }
  SampleAssembler assembler{default_layout(), 100};
  std::vector<RawSample> samples;
};

TEST(Crc8, HandValues) {
  EXPECT_EQ(crc8(Bytes{0x00}), 0x00);
  EXPECT_EQ(crc8(Bytes{0x01}), 0x1D);
  // 80h: 1D after the first shift, then 3A 74 E8 CD 87 13 26
  EXPECT_EQ(crc8(Bytes{0x80}), 0x26);
  const std::string check = "123456789";
  EXPECT_EQ(crc8(Bytes(check.begin(), check.end())), 0x37);  // CRC-8/GSM-A in the CRC catalogue
}

TEST(FrameLayout, DecodesLiteralBytes) {
  const FrameLayout layout = default_layout();
  const Bytes a = {0x34, 0x01, 0xFE, 0xFF, 0xFF, 0x56, 0x34, 0x12};
  Bytes b = {0x34, 0xD0, 0x07, 0x00, 0x00, 0x80, 0x12, 0x00};
  CanFrame fa, fb;
  std::copy(a.begin(), a.end(), fa.data.begin());
  std::copy(b.begin(), b.end(), fb.data.begin());
  b[7] = reference_crc(fa, fb);
  const auto decoded = layout.decode({a, b});
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->counter, 0x1234);
  EXPECT_EQ(decoded->sample.code, (PerAxis<std::int32_t>{-2, 0x123456, -8388608}));
  EXPECT_EQ(decoded->sample.status, 1);
  EXPECT_DOUBLE_EQ(decoded->sample.temp_C, 20.0);
  b[7] ^= 1;
  EXPECT_FALSE(layout.decode({a, b}));
}

TEST(FrameLayout, RefusesWhatCannotBeBound) {
  const Dbc dbc = *parse_dbc(default_dbc_text(), "plumbline.dbc");
  SignalRoles roles;
  roles.x = "ACC_A.XX";
  EXPECT_EQ(FrameLayout::bind(dbc, roles, {}).error().message,
            "signal x = \"ACC_A.XX\": message ACC_A has no signal XX");
  roles = {};
  roles.z = "ENV.Humidity";
  EXPECT_EQ(FrameLayout::bind(dbc, roles, {}).error().message,
            "signal z = \"ENV.Humidity\": is in neither of the messages with the counters");
  EXPECT_EQ(FrameLayout::bind(dbc, {}, {{"rh_pct", "Humidity"}}).error().message,
            "signal rh_pct = \"Humidity\": must be MESSAGE.Signal");
}

TEST(FrameLayout, Covariates) {
  const FrameLayout layout =
      default_layout({{"rh_pct", "ENV.Humidity"}, {"motor_A", "ENV.MotorCurrent"}});
  CanFrame frame;
  frame.id = 418;
  frame.length = 8;
  frame.data = {0x94, 0x11, 0, 0, 0x18, 0xFC};  // 4500, 0, -1000
  const auto values = layout.covariates(frame);
  ASSERT_EQ(values.size(), 2u);
  EXPECT_EQ(*values[0].column, "rh_pct");
  EXPECT_DOUBLE_EQ(values[0].value, 45.0);
  EXPECT_DOUBLE_EQ(values[1].value, -1.0);
}

TEST_F(Assembler, CountsTimeFromTheFirstSampleByTheCounter) {
  for (int counter = 1000; counter < 1010; ++counter) push(counter);
  ASSERT_EQ(samples.size(), 10u);
  EXPECT_EQ(samples[0].counter, 1000);
  EXPECT_DOUBLE_EQ(samples[0].t_s, 0.0);
  EXPECT_DOUBLE_EQ(samples[9].t_s, 0.09);
  EXPECT_EQ(assembler.statistics().lost_samples, 0u);
}

TEST_F(Assembler, WrapsFrom65535To0) {
  for (int counter = 65530; counter < 65546; ++counter) push(counter & 0xFFFF);
  ASSERT_EQ(samples.size(), 16u);
  EXPECT_EQ(samples.back().counter, 65545);
  EXPECT_DOUBLE_EQ(samples.back().t_s, 0.15);
  EXPECT_EQ(assembler.statistics().lost_samples, 0u);
}

TEST_F(Assembler, LossesDuplicatesAndLatecomers) {
  push(1);
  push(2);
  push(6);  // 3, 4, 5 lost
  push(6);  // doubled
  push(5);  // late
  push(7);
  ASSERT_EQ(samples.size(), 4u);
  EXPECT_EQ(samples[3].counter, 7);
  EXPECT_EQ(assembler.statistics().lost_samples, 3u);
  EXPECT_EQ(assembler.statistics().out_of_order, 4u);  // two halves each
}

TEST_F(Assembler, HalvesFindEachOtherInAnyOrder) {
  const auto one = sample_frames(1, 1, 1, 1);
  const auto two = sample_frames(2, 2, 2, 2);
  push(one.a);
  push(two.a);
  push(one.b);
  push(two.b);
  const auto three = sample_frames(3, 3, 3, 3);
  push(three.b);
  push(three.a);
  ASSERT_EQ(samples.size(), 3u);
  EXPECT_EQ(samples[2].code, (PerAxis<std::int32_t>{3, 3, 3}));
  EXPECT_EQ(assembler.statistics().out_of_order, 0u);
}

TEST_F(Assembler, MissingHalvesAreCountedAndNeverPairedWithOthers) {
  push(sample_frames(1, 1, 1, 1).a);
  for (int counter = 2; counter < 400; ++counter) push(counter);
  push(sample_frames(400, 1, 1, 1).b);
  for (int counter = 401; counter < 800; ++counter) push(counter);
  EXPECT_EQ(samples.size(), 398u + 399u);
  EXPECT_EQ(assembler.statistics().unpaired, 2u);
  EXPECT_EQ(assembler.statistics().lost_samples, 1u);  // 400; 1 came before the first sample
  EXPECT_EQ(assembler.statistics().crc_errors, 0u);
}

TEST_F(Assembler, BadCrcAndShortFramesAreRefused) {
  push(1);
  auto frames = sample_frames(2, 1, 1, 1);
  frames.a.data[3] ^= 0x10;
  push(frames.a);
  push(frames.b);
  frames = sample_frames(3, 1, 1, 1);
  frames.a.length = 7;
  push(frames.a);
  push(4);
  EXPECT_EQ(samples.size(), 2u);
  EXPECT_EQ(assembler.statistics().crc_errors, 2u);
  EXPECT_EQ(assembler.statistics().lost_samples, 2u);
}

TEST_F(Assembler, CanFdFrameCarriesBothHalves) {
  const auto frames = sample_frames(77, 10, -20, 30);
  CanFrame both = frames.a;
  both.length = 16;
  std::copy_n(frames.b.data.begin(), 8, both.data.begin() + 8);
  push(both);
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].code, (PerAxis<std::int32_t>{10, -20, 30}));
}

TEST_F(Assembler, RestartedNodeIsNoticed) {
  for (int counter = 20000; counter < 20010; ++counter) push(counter);
  EXPECT_FALSE(assembler.counter_went_back());
  for (int counter = 0; counter < 100; ++counter) push(counter);
  EXPECT_EQ(samples.size(), 10u);
  EXPECT_TRUE(assembler.counter_went_back());
}

TEST_F(Assembler, ARestartedNodeThatIsAcceptedGoesOnInTime) {
  for (int counter = 20000; counter < 20010; ++counter) push(counter);
  for (int counter = 0; counter < 100; ++counter) push(counter);
  assembler.start_anew(250.4);  // samples that would have come in the meantime
  EXPECT_FALSE(assembler.counter_went_back());
  for (int counter = 100; counter < 103; ++counter) push(counter);
  ASSERT_EQ(samples.size(), 13u);
  EXPECT_EQ(samples[10].counter, 20009 + 250);
  EXPECT_EQ(samples[11].counter, 20009 + 251);
  EXPECT_NEAR(samples[10].t_s - samples[9].t_s, 2.50, 1e-9);
  EXPECT_NEAR(samples[11].t_s - samples[10].t_s, 0.01, 1e-9);
  push(101);  // a latecomer of the new count
  EXPECT_EQ(samples.size(), 13u);
}

TEST(CounterUnwrapper, GoesOnAfterANewStart) {
  CounterUnwrapper unwrapper;
  unwrapper.start_anew(5);  // before the first one: nothing to go on from
  EXPECT_EQ(unwrapper.accept(60000, 0), 60000);
  unwrapper.start_anew(0);  // at least one
  EXPECT_EQ(unwrapper.accept(7, 0), 60001);
  EXPECT_EQ(unwrapper.accept(8, 0), 60002);
  EXPECT_EQ(unwrapper.accept(7, 0), std::nullopt);
}

TEST(CounterUnwrapper, LongSilenceIsCountedInRounds) {
  CounterUnwrapper unwrapper;
  EXPECT_EQ(unwrapper.accept(100, 0), 100);
  EXPECT_EQ(unwrapper.accept(50, 3 * 65536.0 - 500), 50 + 3 * 65536);
  EXPECT_EQ(unwrapper.accept(50, 0), std::nullopt);
  EXPECT_EQ(unwrapper.accept(49, 1), std::nullopt);
  EXPECT_EQ(unwrapper.accept(51, 1), 51 + 3 * 65536);
}

}  // namespace
}  // namespace plumbline::rig
