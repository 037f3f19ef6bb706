// The rig side against the simulated rig as a program of its own: real Modbus, real frames.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <thread>

#include "rig/acquisition.h"
#include "rig/rig_config.h"

namespace plumbline::rig {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

/// plumbline-simrig, running.
class SimulatedRig {
 public:
  explicit SimulatedRig(const std::string& line) {
    std::string name = (std::filesystem::temp_directory_path() / "plumbline-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    const std::string modbus = line == "tcp" ? "tcp:127.0.0.1:0" : "rtu:" + folder_ + "/drive";
    const std::string can = "unix:" + folder_ + "/can";
    const std::string ready = folder_ + "/ready.toml";
    const std::string program = PLUMBLINE_BINARY_DIR "/plumbline-simrig";
    const std::string world = PLUMBLINE_SOURCE_DIR "/rig/sim/worlds/white.toml";
    std::vector<std::string> words = {program, "--world",      world, "--modbus",
                                      modbus,  "--can",        can,   "--speed",
                                      "20",    "--ready-file", ready, "--exit-with-parent"};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    EXPECT_EQ(posix_spawn(&process_, program.c_str(), nullptr, nullptr, arguments.data(), environ),
              0);
    const auto deadline = steady_clock::now() + seconds(30);
    while (!std::filesystem::exists(ready) && steady_clock::now() < deadline) {
      std::this_thread::sleep_for(milliseconds(10));
    }
    auto file = StrictFile::read(ready);
    if (!file) {
      ADD_FAILURE() << file.error().message;
      return;
    }
    StrictTable root = file->root();
    head.modbus = root.text("modbus");
    sensor.can = root.text("can");
    sensor.covariates = {{"rh_pct", "ENV.Humidity"}, {"supply_V", "ENV.Supply"}};
  }
  ~SimulatedRig() {
    kill(process_, SIGTERM);
    waitpid(process_, nullptr, 0);
    std::filesystem::remove_all(folder_);
  }
  SimulatedRig(const SimulatedRig&) = delete;
  SimulatedRig& operator=(const SimulatedRig&) = delete;

  HeadConfig head;
  SensorConfig sensor;

 private:
  std::string folder_;
  pid_t process_ = -1;
};

/// Waits until `wanted` holds of the head's status.
template <class Wanted>
HeadStatus wait_for(DividingHead& head, const Wanted& wanted) {
  const auto deadline = steady_clock::now() + seconds(30);
  HeadStatus last;
  while (steady_clock::now() < deadline) {
    const auto status = head.status();
    if (!status) {
      ADD_FAILURE() << status.error().message;
      return last;
    }
    last = *status;
    if (wanted(last)) return last;
    std::this_thread::sleep_for(milliseconds(5));
  }
  ADD_FAILURE() << "never reached";
  return last;
}

class SimulatedRigTest : public ::testing::TestWithParam<std::string> {};

TEST_P(SimulatedRigTest, HomesMovesAndDeliversSamplesWithoutLoss) {
  SimulatedRig rig(GetParam());
  auto head = make_dividing_head(rig.head);
  ASSERT_TRUE(head) << head.error().message;
  auto source = make_sample_source(rig.sensor);
  ASSERT_TRUE(source) << source.error().message;
  Acquisition acquisition(std::move(*source));
  const auto started = acquisition.start();
  ASSERT_TRUE(started) << started.error().message;

  const auto connected = (*head)->connect();
  ASSERT_TRUE(connected) << connected.error().message;
  ASSERT_TRUE((*head)->start_homing());
  wait_for(**head, [](const HeadStatus& s) { return s.homed && s.ready && !s.moving; });
  const auto limits = (*head)->soft_limits();
  ASSERT_TRUE(limits);
  EXPECT_LT(limits->lower.delta_deg, limits->upper.delta_deg);

  for (const HeadAngles target : {HeadAngles{30, 20}, HeadAngles{-15, 60}}) {
    const auto moved = (*head)->start_move(target);
    ASSERT_TRUE(moved) << moved.error().message;
    const HeadStatus there = wait_for(**head, [](const HeadStatus& s) { return s.in_position; });
    EXPECT_NEAR(there.actual.delta_deg, target.delta_deg, 0.02);
    EXPECT_NEAR(there.actual.h_deg, target.h_deg, 0.02);
    EXPECT_EQ(there.alarm, (std::array<std::uint16_t, 2>{0, 0}));
  }
  ASSERT_TRUE((*head)->stop());
  EXPECT_FALSE((*head)->status()->in_position) << "stopped: no command is under way";

  std::vector<RawSample> samples;
  std::size_t covariates = 0;
  const auto deadline = steady_clock::now() + seconds(30);
  while (samples.size() < 500 && steady_clock::now() < deadline) {
    const auto batch = acquisition.take(milliseconds(200));
    ASSERT_TRUE(batch) << batch.error().message;
    samples.insert(samples.end(), batch->samples.begin(), batch->samples.end());
    covariates += batch->covariates.size();
  }
  ASSERT_GE(samples.size(), 500u);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].counter, samples[i - 1].counter + 1);
    ASSERT_NEAR(samples[i].t_s, 0.01 * static_cast<double>(i), 1e-9);
  }
  EXPECT_GT(covariates, 0u);
  const SourceStatistics statistics = acquisition.statistics();
  EXPECT_EQ(statistics.lost_samples + statistics.crc_errors + statistics.out_of_order +
                statistics.unpaired + statistics.queue_drops,
            0u);
}

INSTANTIATE_TEST_SUITE_P(Lines, SimulatedRigTest, ::testing::Values("tcp", "rtu"),
                         [](const auto& instance) { return instance.param; });

}  // namespace
}  // namespace plumbline::rig
