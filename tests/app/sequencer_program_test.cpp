// The program `plumbline run` from outside: signals, sudden death, resumption, a silent bus, and
// the station page that it serves meanwhile.
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
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "app/config/rig_description.h"
#include "app/sequencer/simulated_rig.h"
#include "app/station/http.h"
#include "storage/run_store.h"
#include "tests/app/http_client.h"

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

  void start(bool resume = false, const std::vector<std::string>& further = {}) {
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
    words.insert(words.end(), further.begin(), further.end());
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

/// `plumbline run --serve` on a port of its own.
class ServedRun : public RunProgram {
 protected:
  void start_serving() {
    start_rig();
    start(false, {"--serve", "--control", "--listen", "127.0.0.1:0"});
    const std::string mark = "station: http://127.0.0.1:";
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (said().find("/\n") == std::string::npos && std::chrono::steady_clock::now() < limit) {
      std::this_thread::sleep_for(milliseconds{5});
    }
    const std::size_t at = said().find(mark);
    ASSERT_NE(at, std::string::npos) << said();
    port_ = std::stoi(said().substr(at + mark.size()));
    host_ = "Host: 127.0.0.1:" + std::to_string(port_) + "\r\n";
  }
  nlohmann::json get(const std::string& path) const {
    const Answer answer =
        app::exchange(port_, "GET " + path + " HTTP/1.1\r\n" + host_ + "Connection: close\r\n\r\n");
    EXPECT_EQ(answer.status, 200) << path;
    return nlohmann::json::parse(answer.body, nullptr, false);
  }
  int order(const std::string& word) const {
    const std::string body = "{\"order\":\"" + word + "\"}";
    const auto csrf = get("/api/station")["csrf"].get<std::string>();
    return app::exchange(port_, "POST /api/order HTTP/1.1\r\n" + host_ + "Origin: http://" +
                                    host_.substr(6) + "Content-Type: application/json\r\n" +
                                    "X-CSRF-Token: " + csrf + "\r\nConnection: close\r\n" +
                                    "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" +
                                    body)
        .status;
  }
  Connection viewer() const {
    Connection connection(port_, 60);
    connection.send("GET /api/stream HTTP/1.1\r\n" + host_ + "\r\n");
    return connection;
  }
  /// Waits until the session says of itself that it is in this state.
  void wait_for_state(const std::string& state) const {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    nlohmann::json live;
    while (std::chrono::steady_clock::now() < limit) {
      live = get("/api/live");
      if (live["phase"] == "running" && live["status"]["state"] == state) return;
      std::this_thread::sleep_for(milliseconds{20});
    }
    FAIL() << state << ", but it is " << live.dump();
  }

  int port_ = 0;
  std::string host_;
};

TEST_F(ServedRun, PageShowsTheRunAndGivesOrders) {
  start_serving();
  wait_for_poses(1);
  EXPECT_EQ(order("pause"), 200);  // first of all: the whole run takes little more than a second
  wait_for_state("paused");
  const long long before = summary().poses;
  std::vector<Connection> viewers;
  for (int i = 0; i < 16; ++i) viewers.push_back(viewer());
  for (Connection& one : viewers) {
    EXPECT_THAT(one.receive_until("data: "), HasSubstr("200 OK"));
  }
  EXPECT_EQ(get("/api/live")["run"]["serial"], "A-1");
  EXPECT_FALSE(get("/api/trace")["trace"].empty());
  std::this_thread::sleep_for(milliseconds{500});
  EXPECT_EQ(summary().poses, before);
  EXPECT_EQ(order("resume"), 200);

  // Everybody hears what came out before the program ends.
  for (Connection& one : viewers) {
    const std::string& seen = one.receive_until("\"decision\":");
    EXPECT_THAT(seen, HasSubstr("\"phase\":\"finished\""));
    EXPECT_THAT(seen, HasSubstr("\"decision\":"));
  }
  EXPECT_EQ(wait_for_end(), 0) << said();
  EXPECT_EQ(summary().state, RunState::finished);
  EXPECT_EQ(summary().poses, kSteps);
  EXPECT_FALSE(Connection(port_).open()) << "the page ends with the run";
}

TEST_F(ServedRun, StopFromThePageEndsTheRunSafely) {
  start_serving();
  Connection one = viewer();
  one.receive_until("data: ");
  wait_for_poses(1);
  EXPECT_EQ(order("stop"), 200);
  EXPECT_THAT(one.receive_until("\"phase\":\"stopped\""), HasSubstr("\"phase\":\"stopped\""));
  EXPECT_EQ(wait_for_end(), 3);
  EXPECT_THAT(said(), HasSubstr("plumbline run --resume"));
  EXPECT_EQ(summary().state, RunState::stopped);
  expect_motors_at_rest();
}

TEST_F(RunProgram, PortThatIsTakenIsSaidBeforeAnythingMoves) {
  const auto other = HttpServer::start(
      {"127.0.0.1", 0}, [](const HttpRequest& /*request*/) { return HttpReply::text(200, ""); });
  ASSERT_TRUE(other.has_value());
  start_rig();
  start(false, {"--serve", "--listen", (*other)->address().text()});
  EXPECT_EQ(wait_for_end(), 2);
  EXPECT_THAT(said(), HasSubstr("cannot listen there"));
  EXPECT_FALSE(fs::exists(folder_ / "run.db"));
}

}  // namespace
}  // namespace plumbline::app
