// What the tests of whole runs share: the real simulated rig in its own process, Modbus over TCP,
// CAN frames over a Unix socket, an SQLite file.
#pragma once

#include <gtest/gtest.h>
#include <modbus/modbus.h>
#include <stdlib.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <regex>
#include <string>
#include <thread>
#include <vector>

#include "app/certificate/language.h"
#include "app/config/rig_description.h"
#include "app/sequencer/session.h"
#include "app/sequencer/simulated_rig.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr double kSpeed = 20;  // what the simulator keeps up with when it is instrumented
#else
constexpr double kSpeed = 100;
#endif

inline const fs::path kWorlds = fs::path(PLUMBLINE_SOURCE_DIR) / "rig/sim/worlds";

/// 4 × 3 positions, 2 verification poses, a soak of 20 s.
constexpr const char* kSmallRig = R"(
[dut]
serial = "SIM-0001"
[gravity]
local_mps2 = 9.81012
[grid]
delta_deg = { start = 0, stop = 270, step = 90 }
h_deg = { start = 0, stop = 40, step = 20 }
[sensor.covariates]
rh_pct = "ENV.Humidity"
[plan]
soak_s = 20
samples_per_pose = 20
verification_poses = 2
[recovery]
wait_s = 3
)";
constexpr std::size_t kSteps = 1 + 12 + 2;

class SequencerRun : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "plumbline-run-XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    configure(kSmallRig);
  }
  void TearDown() override {
    expect_events_in_ukrainian();
    fs::remove_all(folder_);
  }

  /// Whatever these runs made the sequencer and the rig say, a Ukrainian certificate says in
  /// Ukrainian: no two English words in a row are left.
  void expect_events_in_ukrainian() {
    const auto store = storage::RunStore::open_read_only(database());
    if (!store) return;
    const auto runs = store->runs();
    ASSERT_TRUE(runs.has_value()) << runs.error().message;
    const Translator uk(Language::uk);
    const std::regex english("\\b[a-z]{2,} [a-z]{2,}\\b");
    for (const storage::RunSummary& run : *runs) {
      const auto events = store->events(run.id);
      ASSERT_TRUE(events.has_value()) << events.error().message;
      for (const storage::EventRecord& event : *events) {
        // From pose to pose as planned: no certificate lists them.
        const bool routine = std::regex_search(event.text, std::regex("^(mov|settl|sampl)ing: "));
        if (event.kind == "operator" || routine) continue;
        EXPECT_NE(uk.phrase(event.kind), event.kind);
        EXPECT_FALSE(std::regex_search(uk.phrase(event.text), english)) << uk.phrase(event.text);
      }
    }
  }

  void configure(const std::string& text) {
    auto rig = parse_rig_description(text, "rig.toml");
    ASSERT_TRUE(rig.has_value()) << rig.error().message;
    rig_ = *std::move(rig);
    rig_.head.poll_interval = milliseconds{2};
  }

  void start_rig(const std::string& more_world = "", std::uint64_t seed = 7) {
    auto simulated =
        SimulatedRig::start({.world_toml = text_of(kWorlds / "white.toml") + more_world,
                             .speed = kSpeed,
                             .seed = seed});
    ASSERT_TRUE(simulated.has_value()) << simulated.error().message;
    simulated_ = std::make_unique<SimulatedRig>(*std::move(simulated));
    rig_.head.modbus = simulated_->modbus();
    rig_.sensor.can = simulated_->can();
  }

  fs::path database() const { return folder_ / "run.db"; }

  Result<Session> run(bool resume = false, const ProgressObserver& observer = {}) {
    return run_session({.rig = rig_, .database = database(), .resume = resume}, control_, observer);
  }

  storage::StoredRun stored(storage::RunId id = 1) {
    auto store = storage::RunStore::open_read_only(database());
    EXPECT_TRUE(store.has_value()) << store.error().message;
    auto run = store->load(id);
    EXPECT_TRUE(run.has_value()) << run.error().message;
    return *std::move(run);
  }

  /// The head, asked by a second master after the run.
  void expect_motors_at_rest() {
    auto head = rig::make_dividing_head(rig_.head);
    ASSERT_TRUE(head.has_value());
    ASSERT_TRUE((*head)->connect().has_value());
    auto now = (*head)->status();
    ASSERT_TRUE(now.has_value()) << now.error().message;
    EXPECT_FALSE(now->moving);
    // What was stopped from full speed still rings; that dies.
    bool still = false;
    for (int look = 0; look < 5 && !still; ++look) {
      const rig::HeadAngles before = now->actual;
      std::this_thread::sleep_for(std::chrono::duration<double>(2 / kSpeed));  // 2 s for the rig
      now = (*head)->status();
      ASSERT_TRUE(now.has_value()) << now.error().message;
      still = now->actual.delta_deg == before.delta_deg && now->actual.h_deg == before.h_deg;
    }
    EXPECT_TRUE(still) << "turns on";
    EXPECT_EQ(now->alarm[0], 0) << rig::alarm_text(now->alarm[0]);
  }

  /// Texts of the run's events of one kind.
  std::vector<std::string> events(const std::string& kind) {
    std::vector<std::string> texts;
    for (const storage::EventRecord& event : stored().events) {
      if (event.kind == kind) texts.push_back(event.text);
    }
    return texts;
  }

  /// The drive's registers as they are, read by a second master: nothing moves, nobody is watched
  /// for (0x10), and the speed (0x28) is zero.
  void expect_safe_state() {
    expect_motors_at_rest();
    const std::string address = simulated_->modbus();  // tcp:127.0.0.1:PORT
    const std::string port = address.substr(address.rfind(':') + 1);
    modbus_t* context = modbus_new_tcp("127.0.0.1", std::stoi(port));
    ASSERT_EQ(modbus_connect(context), 0);
    modbus_set_slave(context, 1);
    for (const int base : {0x000, 0x100}) {
      std::array<std::uint16_t, 0x2D> registers{};
      ASSERT_EQ(modbus_read_registers(context, base, 0x2D, registers.data()), 0x2D);
      EXPECT_EQ(registers[0x10], 0) << "watchdog";
      EXPECT_EQ(registers[0x20] & (1u << 13 | 1u << 8), 0u) << "MOVE, BUSY";
      EXPECT_EQ(registers[0x28] | registers[0x29], 0) << "speed";
    }
    modbus_close(context);
    modbus_free(context);
  }

  fs::path folder_;
  RigDescription rig_;
  std::unique_ptr<SimulatedRig> simulated_;
  EngineControl control_;
};

}  // namespace plumbline::app
