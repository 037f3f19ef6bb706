// Both sides of the wires together: the rig side as it would meet real hardware, and the simulated
// rig. The two share no code for registers, frames or the CRC.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "rig/acquisition.h"
#include "rig/rig_config.h"
#include "tests/sim/wire_rig.h"

namespace plumbline::sim {
namespace {

using std::chrono::milliseconds;

class WireSeam : public ::testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Carriers, WireSeam, ::testing::Values("tcp", "rtu"),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST_P(WireSeam, HeadHomesMovesAndIsConfirmed) {
  WireRig rig({}, 50);
  rig::HeadConfig config;
  config.modbus = std::string(GetParam()) == "tcp" ? rig.serve_tcp() : rig.serve_rtu();
  auto head = rig::make_dividing_head(config);
  ASSERT_TRUE(head.has_value()) << head.error().message;
  auto connected = (*head)->connect();
  ASSERT_TRUE(connected.has_value()) << connected.error().message;

  const auto status = [&] {
    auto answer = (*head)->status();
    EXPECT_TRUE(answer.has_value()) << answer.error().message;
    return answer.value_or(rig::HeadStatus{});
  };
  EXPECT_FALSE(status().homed);
  ASSERT_TRUE((*head)->start_homing().has_value());
  EXPECT_TRUE(eventually([&] { return status().homed; }));
  ASSERT_TRUE((*head)->start_move({.delta_deg = 123.4, .h_deg = 56.7}).has_value());
  EXPECT_TRUE(eventually([&] { return status().in_position; }));
  EXPECT_NEAR(status().actual.delta_deg, 123.4, 0.006);
  EXPECT_NEAR(status().actual.h_deg, 56.7, 0.006);
  EXPECT_EQ(status().alarm, (std::array<std::uint16_t, 2>{0, 0}));

  auto limits = (*head)->soft_limits();
  ASSERT_TRUE(limits.has_value());
  EXPECT_DOUBLE_EQ(limits->lower.delta_deg, -369);
  EXPECT_DOUBLE_EQ(limits->upper.h_deg, 94);
}

/// A source for the other end of the rig's CAN socket.
std::unique_ptr<rig::SampleSource> make_source(WireRig& rig, const World& world) {
  rig::SensorConfig config;
  config.can = rig.serve_can();
  config.rate_hz = world.rate_hz;
  config.adc = world.adc;
  config.covariates = {{.column = "rh_pct", .signal = "ENV.Humidity"}};
  auto source = rig::make_sample_source(config);
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return std::move(*source);
}

/// Reads until there are `count` samples; a stretch without any ends it.
rig::SampleBatch read_batch(rig::SampleSource& source, std::size_t count) {
  rig::SampleBatch all;
  EXPECT_TRUE(eventually([&] {
    auto batch = source.read(milliseconds(100));
    EXPECT_TRUE(batch.has_value()) << batch.error().message;
    if (!batch) return true;
    all.samples.insert(all.samples.end(), batch->samples.begin(), batch->samples.end());
    all.covariates.insert(all.covariates.end(), batch->covariates.begin(), batch->covariates.end());
    return all.samples.size() >= count;
  }));
  return all;
}

TEST(WireSeamNode, SourceGetsEverySampleIntact) {
  const World world;
  WireRig rig({}, 100, world);
  const auto source = make_source(rig, world);
  ASSERT_TRUE(source->open().has_value());
  const rig::SampleBatch batch = read_batch(*source, 5000);
  const std::vector<RawSample>& samples = batch.samples;
  ASSERT_GE(samples.size(), 5000u);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].counter, samples[i - 1].counter + 1);
    ASSERT_NEAR(samples[i].t_s - samples[i - 1].t_s, 0.01, 1e-9);
  }
  EXPECT_NEAR(static_cast<double>(batch.covariates.size()),
              static_cast<double>(samples.size()) / 10, 2);
  const rig::SourceStatistics statistics = source->statistics();
  EXPECT_EQ(statistics.lost_samples, 0u);
  EXPECT_EQ(statistics.crc_errors, 0u);
  EXPECT_EQ(statistics.out_of_order, 0u);
  EXPECT_EQ(statistics.unpaired, 0u);
}

TEST(WireSeamNode, ReplyWaitsForANodeThatGetsNoTime) {
  WireRig rig;
  rig.machine.attach_node(true);
  EXPECT_TRUE(eventually([&] { return !rig.machine.take_samples().empty(); }));
  std::atomic<bool> on_the_bus = false;
  const std::jthread node([&] {
    std::this_thread::sleep_for(milliseconds(700));
    on_the_bus = true;
    rig.machine.sent();
  });
  rig.machine.wait_until_sent();
  EXPECT_TRUE(on_the_bus);
}

TEST(WireSeamNode, AnAcceleratedWorldWaitsForAMasterThatGetsNoTime) {
  using Clock = std::chrono::steady_clock;
  WireRig rig({}, 100);
  ModbusClient master(rig.serve_tcp());
  const auto world_s = [&] {
    return rig.machine.with_drive([](Drive&, double t_s) { return t_s; });
  };
  master.read16(0x20);
  const auto begin = Clock::now();
  const double begin_s = world_s();
  std::this_thread::sleep_for(milliseconds(300));
  const double passed_s = world_s() - begin_s;
  const std::chrono::duration<double> host = Clock::now() - begin;
  if (host.count() < 1.5) {
    EXPECT_LT(passed_s, 100 * host.count() / 2);
  }
  // One that has gone is not waited for.
  EXPECT_TRUE(eventually([&] { return world_s() - begin_s > 100; }));
}

TEST(WireSeamNode, SourceCountsWhatTheNodeSpoils) {
  const Fault silence{.kind = FaultKind::can_silence, .move = 0, .count = 7};
  const Fault bus_off{
      .kind = FaultKind::can_error_frame, .move = 0, .delay_s = 1, .count = 3, .value = 0x40};
  WireRig rig({.all = {silence, bus_off}}, 20);
  // Read on a thread of its own, as a run does it: the drive's replies wait for the node, and the
  // node for its reader.
  rig::Acquisition acquisition(make_source(rig, {}));
  ASSERT_TRUE(acquisition.start().has_value());
  EXPECT_TRUE(eventually([&] { return acquisition.statistics().samples >= 100; }));
  ModbusClient(rig.serve_tcp()).move(0x000, 100000, 1);
  EXPECT_TRUE(eventually([&] { return acquisition.statistics().error_frames == 3; }));
  EXPECT_EQ(acquisition.statistics().lost_samples, 7u);
}

}  // namespace
}  // namespace plumbline::sim
