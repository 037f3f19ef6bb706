// `ctl`, `doctor`, `jobs`, the journal, summary and hook: as a person or a script meets them.
#include <gmock/gmock.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "app/sequencer/simulated_rig.h"
#include "tests/app/program.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

constexpr const char* kPlan = R"(
[grid]
delta_deg = { start = 0, stop = 270, step = 90 }
h_deg = { start = 0, stop = 40, step = 20 }
[plan]
soak_s = 5
samples_per_pose = 20
verification_poses = 4
[recovery]
wait_s = 2
)";

/// Whoever stops a run needs one that is not over before.
constexpr const char* kLongPlan = R"(
[plan]
soak_s = 5
samples_per_pose = 20
verification_poses = 4
)";

class NightProgram : public testing::Test {
 protected:
  void start_rig(const std::string& faults = "", const std::string& plan = kPlan) {
    const fs::path world = fs::path(PLUMBLINE_SOURCE_DIR) / "rig/sim/worlds/white.toml";
    auto simulated =
        SimulatedRig::start({.world_toml = text_of(world) + faults, .speed = 40, .seed = 3});
    ASSERT_TRUE(simulated.has_value()) << simulated.error().message;
    rig_ = std::make_unique<SimulatedRig>(*std::move(simulated));
    write_text(config(),
               "[dut]\nserial = \"A-1\"\n[gravity]\nlocal_mps2 = 9.81012\n[head]\nmodbus = \"" +
                   rig_->modbus() +
                   "\"\nwatchdog_ms = 10000\npoll_interval_ms = 2\n"
                   "identity_address = 0x200\nidentity_count = 4\n"
                   "soft_limits = { delta_deg = [-369, 369], h_deg = [-94, 94] }\n"
                   "[sensor]\ncan = \"" +
                   rig_->can() + "\"\nidentity = \"IDENT.Serial\"\n" + plan);
  }
  std::string config() const { return folder_ / "rig.toml"; }
  std::string hooks() const { return folder_ / "hooks"; }
  std::string hook() const {
    return "echo $PLUMBLINE_EVENT $PLUMBLINE_SERIAL $PLUMBLINE_EXIT_CODE >> " + hooks();
  }
  /// A queue that begins by recording one position.
  static std::string soak_first(const std::string& more_settings = "") {
    return R"(
config = "rig.toml"
database = "night.db"
out = "night"
[[job]]
name = "soak"
serial = "A-1"
action = "record"
set = { )" +
           more_settings +
           R"(plan = { verification_poses = 0 }, grid = { delta_deg = { start = 0, stop = 0, step = 90 }, h_deg = { start = 0, stop = 0, step = 10 } } }
)";
  }
  std::string database() const { return folder_ / "run.db"; }
  ProgramOutcome run(const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"run",  "--config", config(), "--serial",     "A-1",
                                      "--db", database(), "--out",  folder_ / "out"};
    words.insert(words.end(), more.begin(), more.end());
    return run_plumbline(words);
  }
  ProgramOutcome ctl(std::vector<std::string> words) {
    words.insert(words.begin(), {"ctl", "--db", database()});
    return run_plumbline(words);
  }
  json status() {
    const ProgramOutcome outcome = ctl({"status", "--json"});
    return outcome.exit_code == 0 ? json::parse(outcome.out) : json();
  }
  bool wait_until(const std::function<bool(const json&)>& holds) {
    for (int i = 0; i < 600; ++i) {
      const json now = status();
      if (now.is_object() && holds(now)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }

  TempFolder folder_;
  std::unique_ptr<SimulatedRig> rig_;
};

TEST_F(NightProgram, CtlPausesResumesShowsAndStops) {
  start_rig("", kLongPlan);
  EXPECT_EQ(ctl({"status"}).exit_code, 2) << "nobody is there";
  const std::string summary = folder_ / "exit.json";
  ProgramOutcome ended;
  std::thread session([&] { ended = run({"--summary", summary, "--hook", hook()}); });
  ASSERT_TRUE(wait_until([](const json& now) { return now["done"] >= 2; }));
  EXPECT_EQ(ctl({"pause"}).exit_code, 0);
  ASSERT_TRUE(wait_until([](const json& now) { return now["state"] == "paused"; }));
  const json paused = status();
  EXPECT_EQ(paused["reason"], "asked to pause");
  EXPECT_EQ(paused["head"]["moving"], false);
  EXPECT_EQ(paused["serial"], "A-1");
  EXPECT_THAT(ctl({"status"}).out, HasSubstr("paused: asked to pause"));
  EXPECT_THAT(run().err, HasSubstr("another session is running"));

  EXPECT_EQ(ctl({"resume"}).exit_code, 0);
  const auto done = paused["done"].get<int>();
  ASSERT_TRUE(wait_until([&](const json& now) { return now["done"] >= done + 2; }));
  EXPECT_EQ(ctl({"stop", "--wait"}).exit_code, 0);
  session.join();
  EXPECT_EQ(ended.exit_code, 3);
  EXPECT_THAT(ended.err, HasSubstr("stopped on request"));

  const json exit = json::parse(text_of(summary));
  EXPECT_EQ(exit["schema"], "plumbline.exit/1");
  EXPECT_EQ(exit["exit_code"], 3);
  EXPECT_EQ(exit["state"], "stopped");
  EXPECT_THAT(exit["resume"], HasSubstr("plumbline run --resume"));
  EXPECT_EQ(exit["chain_head"].get<std::string>().size(), 64u);
  EXPECT_EQ(text_of(hooks()), "end A-1 3\n");
  EXPECT_THAT(text_of(database() + ".log"), HasSubstr("pause: asked to pause"));
  EXPECT_FALSE(fs::exists(database() + ".ctl"));
  EXPECT_THAT(run_plumbline({"verify", "--db", database()}).out, HasSubstr("unbroken"));
}

TEST_F(NightProgram, DoctorFindsEverythingInOrder) {
  start_rig();
  const ProgramOutcome outcome =
      run_plumbline({"doctor", "--config", config(), "--db", database()});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("the drive answers"));
  EXPECT_THAT(outcome.out, HasSubstr("identity 0000-7AB7"));
  EXPECT_THAT(outcome.out, HasSubstr("serial number 2718"));
  EXPECT_THAT(outcome.out, HasSubstr("Everything that a run needs is there."));
}

TEST_F(NightProgram, DoctorSaysWhatToDo) {
  write_text(config(), std::string("[dut]\nserial = \"A-1\"\n[gravity]\nlocal_mps2 = 9.81\n"
                                   "[head]\nmodbus = \"tcp:127.0.0.1:1\"\n"
                                   "[sensor]\ncan = \"can:nosuchcan7\"\n") +
                           kPlan);
  const ProgramOutcome outcome =
      run_plumbline({"doctor", "--config", config(), "--db", database()});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.out, HasSubstr("tcp:127.0.0.1:1: cannot connect"));
  EXPECT_THAT(outcome.out, HasSubstr("there is no interface nosuchcan7"));
  EXPECT_THAT(outcome.out, HasSubstr("must be put right"));
}

TEST_F(NightProgram, AQueueIsDoneOnceAndGoesOnWhereItWas) {
  start_rig();
  const std::string queue = folder_ / "night.toml";
  write_text(queue,
             soak_first() +
                 R"(wait_for = { column = "temp_C", min = -50, max = 100, hold_s = 2, limit_s = 60 }
[[job]]
name = "unit"
serial = "A-1"
[[job]]
name = "check"
serial = "A-1"
action = "verify"
against = "unit"
set = { plan = { soak_s = 0, verification_poses = 0 } }
)");
  const ProgramOutcome estimate = run_plumbline({"jobs", queue, "--estimate"});
  EXPECT_EQ(estimate.exit_code, 0) << estimate.err;
  EXPECT_THAT(estimate.out, HasSubstr("3 jobs, about"));
  EXPECT_FALSE(fs::exists(folder_ / "night"));

  const ProgramOutcome first = run_plumbline({"jobs", queue});
  EXPECT_EQ(first.exit_code, 0) << first.out << first.err;
  EXPECT_TRUE(fs::exists(folder_ / "night/unit/result.json"));
  EXPECT_TRUE(fs::exists(folder_ / "night/check/evaluation.json"));
  const json ledger = json::parse(text_of(folder_ / "night/jobs.json"));
  EXPECT_EQ(ledger["jobs"].size(), 3u);

  const ProgramOutcome second = run_plumbline({"jobs", queue});
  EXPECT_EQ(second.exit_code, 0) << second.err;
  EXPECT_THAT(second.out, HasSubstr("job check: done before"));
  const auto runs = [this] {
    return json::parse(run_plumbline({"runs", "--db", folder_ / "night.db", "--json"}).out);
  };
  EXPECT_EQ(runs()["runs"].size(), 3u);

  // The power was cut after the last pose of the last job, before anything came of it.
  json cut = ledger;
  cut["jobs"][2]["done"] = false;
  write_text(folder_ / "night/jobs.json", cut.dump());
  fs::remove_all(folder_ / "night/check");
  const ProgramOutcome third = run_plumbline({"jobs", queue});
  EXPECT_EQ(third.exit_code, 0) << third.err;
  EXPECT_TRUE(fs::exists(folder_ / "night/check/evaluation.json"));
  EXPECT_EQ(runs()["runs"].size(), 3u) << "it was measured again";
}

TEST_F(NightProgram, WaitingForAConditionOutlastsASilentSensor) {
  start_rig("\n[[faults]]\nkind = \"can.silence\"\nat_s = 60\nduration_s = 40\n");
  const std::string queue = folder_ / "night.toml";
  const auto with_wait = [&](const std::string& wait) {
    write_text(queue, "hook = \"" + hook() + "\"" +
                          soak_first("sensor = { silence_timeout_ms = 200 }, ") + wait);
    return run_plumbline({"jobs", queue});
  };
  const ProgramOutcome met =
      with_wait("wait_for = { column = \"temp_C\", min = -50, max = 100, hold_s = 100 }\n");
  EXPECT_EQ(met.exit_code, 0) << met.out << met.err;
  EXPECT_EQ(text_of(hooks()), "end A-1 0\n");

  // On another night it is not done: the run of before is not taken for this one's.
  fs::remove_all(folder_ / "night");
  std::this_thread::sleep_for(std::chrono::seconds(1));  // runs tell when they began in seconds
  const ProgramOutcome never = with_wait(
      "wait_for = { column = \"temp_C\", min = 200, max = 300, hold_s = 1, limit_s = 20 }\n");
  EXPECT_EQ(never.exit_code, 3) << never.out;
  EXPECT_THAT(never.err, HasSubstr("temp_C was not within 200 to 300"));
  EXPECT_EQ(text_of(hooks()), "end A-1 0\nend A-1 3\n") << "nobody was told";
}

TEST_F(NightProgram, TheJournalRotates) {
  start_rig();
  const std::string journal = database() + ".log";
  write_text(journal, std::string(1'999'999, 'x') + "\n");
  EXPECT_EQ(run().exit_code, 0);
  EXPECT_EQ(fs::file_size(folder_ / "run.db.1.log"), 2'000'000u);
  EXPECT_LT(fs::file_size(journal), 100'000u);
  EXPECT_THAT(text_of(journal), HasSubstr("state: finished"));
}

TEST_F(NightProgram, AQueueThatMakesNoSenseIsRefused) {
  start_rig();
  const std::string queue = folder_ / "night.toml";
  const std::string head = "config = \"rig.toml\"\ndatabase = \"n.db\"\nout = \"n\"\n";
  const auto refusal = [&](const std::string& jobs) {
    write_text(queue, head + jobs);
    const ProgramOutcome outcome = run_plumbline({"jobs", queue, "--estimate"});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.error_lines(), 1);
    return outcome.err;
  };
  EXPECT_THAT(refusal(""), HasSubstr("there is no [[job]]"));
  EXPECT_THAT(refusal("[[job]]\nname = \"a\"\nserial = \"A\"\nactoin = \"record\"\n"),
              HasSubstr("did you mean action"));
  EXPECT_THAT(refusal("[[job]]\nname = \"a\"\nserial = \"A\"\nset = { plan = { sok_s = 3 } }\n"),
              HasSubstr("soak_s"));
  EXPECT_THAT(
      refusal("[[job]]\nname = \"a\"\nserial = \"A\"\naction = \"verify\"\nagainst = \"b\"\n"),
      HasSubstr("against"));
  EXPECT_THAT(
      refusal("[[job]]\nname = \"a\"\nserial = \"A\"\n[[job]]\nname = \"a\"\nserial = \"A\"\n"),
      HasSubstr("twice"));
  EXPECT_THAT(refusal("[[job]]\nname = \"../a\"\nserial = \"A\"\n"), HasSubstr("name of a folder"));
}

}  // namespace
}  // namespace plumbline::app
