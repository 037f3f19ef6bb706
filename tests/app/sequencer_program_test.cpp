// The program `plumbline run` from outside: signals, sudden death, resumption, a silent bus.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "app/config/rig_description.h"
#include "app/sequencer/simulated_rig.h"
#include "storage/run_store.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using storage::RunState;
using testing::HasSubstr;

constexpr const char* kRig = R"(
[dut]
serial = "A-1"
[gravity]
local_mps2 = 9.81012
[grid]
delta_deg = { start = 0, stop = 270, step = 90 }
h_deg = { start = 0, stop = 40, step = 20 }
[plan]
soak_s = 10
samples_per_pose = 20
verification_poses = 2
[recovery]
wait_s = 2
)";
constexpr long long kSteps = 15;

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class RunProgram : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "plumbline-prog-XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override {
    if (program_ > 0) {
      kill(program_, SIGKILL);
      waitpid(program_, nullptr, 0);
    }
    fs::remove_all(folder_);
  }

  void start_rig(const std::string& faults = "") {
    const fs::path world = fs::path(PLUMBLINE_SOURCE_DIR) / "rig/sim/worlds/white.toml";
    auto simulated =
        SimulatedRig::start({.world_toml = text_of(world) + "\n" + faults, .speed = 40, .seed = 3});
    ASSERT_TRUE(simulated.has_value()) << simulated.error().message;
    rig_ = std::make_unique<SimulatedRig>(*std::move(simulated));
    std::ofstream(folder_ / "rig.toml")
        << kRig << "[head]\nmodbus = \"" << rig_->modbus()
        << "\"\nwatchdog_ms = 500\npoll_interval_ms = 2\n[sensor]\ncan = \"" << rig_->can()
        << "\"\nsilence_timeout_ms = 800\n";
  }

  void start(bool resume = false) {
    std::vector<std::string> words = {std::string(PLUMBLINE_BINARY_DIR) + "/plumbline",
                                      "run",
                                      "--config",
                                      folder_ / "rig.toml",
                                      "--serial",
                                      "A-1",
                                      "--db",
                                      folder_ / "run.db",
                                      "--out",
                                      folder_ / "out"};
    if (resume) words.emplace_back("--resume");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    const std::string err = folder_ / "err";
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ASSERT_EQ(posix_spawn(&program_, words[0].c_str(), &files, nullptr, arguments.data(), environ),
              0);
    posix_spawn_file_actions_destroy(&files);
  }

  /// Exit code, or −signal.
  int wait_for_end() {
    int status = 0;
    waitpid(program_, &status, 0);
    program_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  storage::RunSummary summary() {
    auto store = storage::RunStore::open_read_only(folder_ / "run.db");
    if (!store) return {};
    const auto runs = store->runs();
    return runs && !runs->empty() ? runs->back() : storage::RunSummary{};
  }

  void wait_for_poses(long long count) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (summary().poses < count && std::chrono::steady_clock::now() < limit) {
      std::this_thread::sleep_for(milliseconds{5});
    }
    ASSERT_GE(summary().poses, count);
  }

  void expect_motors_at_rest() {
    const auto description = read_rig_description(folder_ / "rig.toml");
    ASSERT_TRUE(description.has_value()) << description.error().message;
    auto head = rig::make_dividing_head(description->head);
    ASSERT_TRUE(head.has_value());
    ASSERT_TRUE((*head)->connect().has_value());
    const auto status = (*head)->status();
    ASSERT_TRUE(status.has_value()) << status.error().message;
    EXPECT_FALSE(status->moving);
  }

  std::string said() const { return text_of(folder_ / "err"); }

  fs::path folder_;
  std::unique_ptr<SimulatedRig> rig_;
  pid_t program_ = -1;
};

TEST_F(RunProgram, CtrlCStopsTheMotorsAndSaysHowToResume) {
  start_rig();
  start();
  wait_for_poses(4);
  kill(program_, SIGINT);
  EXPECT_EQ(wait_for_end(), 3);
  EXPECT_THAT(said(), HasSubstr("stopped on request"));
  EXPECT_THAT(said(), HasSubstr("plumbline run --resume"));
  EXPECT_EQ(summary().state, RunState::stopped);
  expect_motors_at_rest();

  start(true);
  EXPECT_EQ(wait_for_end(), 0) << said();
  EXPECT_EQ(summary().state, RunState::finished);
  EXPECT_EQ(summary().poses, kSteps);
  EXPECT_TRUE(fs::exists(folder_ / "out/result.json"));
}

TEST_F(RunProgram, SuddenDeathLosesNothing) {
  start_rig();
  start();
  wait_for_poses(5);
  kill(program_, SIGKILL);
  EXPECT_EQ(wait_for_end(), -SIGKILL);
  const long long kept = summary().poses;
  EXPECT_GE(kept, 5);
  EXPECT_EQ(summary().state, RunState::running);
  std::this_thread::sleep_for(milliseconds{1000});  // the drive's watchdog is set to 0.5 s
  expect_motors_at_rest();

  start(true);
  EXPECT_EQ(wait_for_end(), 0) << said();
  EXPECT_EQ(summary().state, RunState::finished);
  EXPECT_EQ(summary().poses, kSteps);
}

TEST_F(RunProgram, SilentBusEndsTheRunSafely) {
  start_rig("[[faults]]\nkind = \"can.silence\"\nat_s = 30\nduration_s = 100000\n");
  const auto begin = std::chrono::steady_clock::now();
  start();
  EXPECT_EQ(wait_for_end(), 3);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
  EXPECT_THAT(said(), HasSubstr("no sample for 0.8 s"));
  EXPECT_EQ(summary().state, RunState::failed);
  EXPECT_FALSE(fs::exists(folder_ / "out/result.json"));
  expect_motors_at_rest();
}

}  // namespace
}  // namespace plumbline::app
