// The control socket over the real wire: orders, status, watching, manners.
#include "app/sequencer/control_socket.h"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <fstream>

#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

using testing::HasSubstr;
using Pause = EngineControl::Pause;

class ControlSocketTest : public testing::Test {
 protected:
  ControlSocketTest() : path_(folder_ / "run.db.ctl") {
    live_ = std::make_unique<LiveState>(LiveRun{.serial = "A-1",
                                                .database = "run.db",
                                                .out = "out",
                                                .started_utc = "2026-01-02T03:04:05Z",
                                                .rate_hz = 100,
                                                .adc = {}});
  }
  void open() { server_ = ControlSocket::open(path_, *live_, control_).value(); }
  Json ask(const Json& request) {
    auto client = ControlClient::connect(path_);
    EXPECT_TRUE(client) << client.error().message;
    return client->ask(request).value();
  }
  Progress progress(EngineState state) {
    Progress progress;
    progress.run = 7;
    progress.state = state;
    progress.reason = "why";
    progress.steps = 10;
    return progress;
  }

  TempFolder folder_;
  std::filesystem::path path_;
  std::unique_ptr<LiveState> live_;
  EngineControl control_;
  std::unique_ptr<ControlSocket> server_;
};

TEST_F(ControlSocketTest, OrdersReachTheEngine) {
  open();
  EXPECT_EQ(ask({{"command", "pause"}}), Json({{"ok", true}}));
  EXPECT_EQ(control_.pause_requested(), Pause::now);
  ask({{"command", "pause"}, {"at", "pose"}});
  EXPECT_EQ(control_.pause_requested(), Pause::at_pose);
  ask({{"command", "resume"}});
  EXPECT_EQ(control_.pause_requested(), Pause::none);
  EXPECT_FALSE(control_.stop_requested());
  ask({{"command", "stop"}});
  EXPECT_TRUE(control_.stop_requested());
  EXPECT_FALSE(control_.abort_requested());
  ask({{"command", "abort"}});
  EXPECT_TRUE(control_.abort_requested());
}

TEST_F(ControlSocketTest, NonsenseIsRefusedAndHarmless) {
  open();
  for (const Json& request :
       {Json("stop"), Json::object(), Json({{"command", 3}}), Json({{"command", "fly"}}),
        Json({{"command", "pause"}, {"at", "noon"}}), Json({{"command", "pause"}, {"at", 3}}),
        Json({{"command", "poses"}, {"first", -1}}),
        Json({{"command", "watch"}, {"interval_ms", 1}})}) {
    const Json reply = ask(request);
    EXPECT_EQ(reply["ok"], false) << request;
    EXPECT_FALSE(reply["error"].get<std::string>().empty());
  }
  EXPECT_EQ(control_.pause_requested(), Pause::none);
  EXPECT_FALSE(control_.stop_requested());
}

TEST_F(ControlSocketTest, StatusIsComplete) {
  open();
  Progress now = progress(EngineState::sampling);
  now.planned_done_s = 25;
  now.planned_total_s = 100;
  now.newest = RawSample{.counter = 5, .t_s = 1.5, .code = {0, 0, 0}, .temp_C = 21, .status = 0};
  PoseMean pose;
  pose.step = 3;
  pose.mean_V = {-2.5, -2.4, -2.3};
  now.last_pose = pose;
  now.events = 1;
  now.last_event = {1.25, "2026-01-02T03:04:06Z", "retry", "a \"fault\"\n\xff"};
  live_->update(now);
  const Json status = ask({{"command", "status"}})["status"];
  EXPECT_EQ(status["schema"], "plumbline.status/1");
  EXPECT_EQ(status["pid"], ::getpid());
  EXPECT_EQ(status["run"], 7);
  EXPECT_EQ(status["state"], "sampling");
  EXPECT_EQ(status["reason"], "why");
  EXPECT_EQ(status["progress"], 0.25);
  EXPECT_EQ(status["newest"]["u_V"], Json({-2.5, -2.5, -2.5}));
  EXPECT_EQ(status["samples"].size(), 1u);
  EXPECT_EQ(status["last_pose"]["mean_V"], Json({-2.5, -2.4, -2.3}));
  EXPECT_EQ(status["events"][0]["kind"], "retry");
  EXPECT_EQ(status["poses"], 1);
  const Json poses = ask({{"command", "poses"}, {"first", 0}});
  EXPECT_EQ(poses["total"], 1);
  EXPECT_EQ(poses["poses"][0]["step"], 3);
  EXPECT_EQ(ask({{"command", "poses"}, {"first", 5}})["poses"], Json::array());
}

TEST_F(ControlSocketTest, AWatcherSeesEveryChangeAndTheEnd) {
  open();
  auto client = ControlClient::connect(path_).value();
  ASSERT_EQ(client.ask({{"command", "watch"}, {"interval_ms", 10000}}).value()["ok"], true);
  ASSERT_TRUE(client.receive(5));  // as it is
  for (const EngineState state : {EngineState::homing, EngineState::moving, EngineState::failed}) {
    live_->update(progress(state));
    const auto line = client.receive(5);
    ASSERT_TRUE(line) << line.error().message;
    EXPECT_EQ((*line)["status"]["state"], to_string(state));
  }
  server_.reset();
  ASSERT_TRUE(client.receive(5)) << "how it ended";
  EXPECT_FALSE(client.receive(5)) << "and that it has";
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(ControlSocketTest, OneSessionAtATimeButADeadOneIsReplaced) {
  open();
  const auto second = ControlSocket::open(path_, *live_, control_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::input);
  EXPECT_THAT(second.error().message, HasSubstr("another session is running"));
  server_.reset();

  // What a killed session leaves behind.
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  std::strncpy(name.sun_path, path_.c_str(), sizeof name.sun_path - 1);
  ASSERT_EQ(::bind(dead, reinterpret_cast<sockaddr*>(&name), sizeof name), 0);
  ::close(dead);
  open();
  EXPECT_EQ(ask({{"command", "status"}})["ok"], true);
}

TEST_F(ControlSocketTest, IsForItsOwnerOnlyAndAtAnyDepth) {
  std::filesystem::path deep = folder_ / std::string(90, 'a') / std::string(90, 'b');
  std::filesystem::create_directories(deep);
  path_ = deep / "run.db.ctl";
  open();
  struct stat status {};
  ASSERT_EQ(::stat(path_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  EXPECT_EQ(ask({{"command", "status"}})["ok"], true);
}

TEST_F(ControlSocketTest, AnOrdinaryFileIsNotRemoved) {
  std::ofstream(path_) << "precious";
  EXPECT_FALSE(ControlSocket::open(path_, *live_, control_));
  EXPECT_TRUE(std::filesystem::exists(path_));
}

TEST_F(ControlSocketTest, ManyClientsAndOneThatNeverReads) {
  open();
  auto lazy = ControlClient::connect(path_).value();
  for (int i = 0; i < 2000; ++i) {
    if (!lazy.send({{"command", "status"}})) break;  // put out when too far behind
  }
  std::vector<ControlClient> clients;
  for (int i = 0; i < 20; ++i) clients.push_back(ControlClient::connect(path_).value());
  for (ControlClient& client : clients) {
    EXPECT_EQ(client.ask({{"command", "status"}}).value()["ok"], true);
  }
}

}  // namespace
}  // namespace plumbline::app
