// Pauses on request and by conditions; the safe state after every way of ending.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <sys/resource.h>

#include <atomic>
#include <csignal>

#include "tests/app/sequencer_fixture.h"

namespace plumbline::app {
namespace {

using storage::RunState;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using Pause = EngineControl::Pause;

class SequencerPause : public SequencerRun {
 protected:
  /// Starts the run and, once paused, looks at the drive and goes on.
  Result<Session> run_with_pause(Pause when, EngineState at) {
    bool asked = false;
    std::atomic<bool> paused = false;
    std::thread other([&] {
      while (!paused) std::this_thread::sleep_for(milliseconds{2});
      expect_motors_at_rest();
      control_.request_resume();
    });
    auto session = run(false, [&](const Progress& progress) {
      if (!asked && progress.step == 5 && progress.state == at) {
        asked = true;
        control_.request_pause(when);
      }
      if (progress.state == EngineState::paused) {
        done_when_paused_ = progress.done;
        paused = true;
      }
      if (progress.state == EngineState::failed) paused = true;
    });
    paused = true;
    other.join();
    return session;
  }
  std::size_t done_when_paused_ = 0;
};

TEST_F(SequencerPause, NowStopsTheMotorsAndThePoseIsMeasuredAnew) {
  for (const EngineState at : {EngineState::moving, EngineState::sampling}) {
    start_rig();
    const auto session = run_with_pause(Pause::now, at);
    ASSERT_TRUE(session.has_value()) << session.error().message;
    ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
    // A pose whose samples have all arrived by then is committed first, on a busy machine.
    EXPECT_GE(done_when_paused_, 5u);
    EXPECT_LE(done_when_paused_, at == EngineState::moving ? 5u : 6u);
    EXPECT_THAT(events("pause"), SizeIs(1));
    EXPECT_THAT(events("go on"), SizeIs(1));
    EXPECT_THAT(events("retry"), IsEmpty()) << "a pause is no failed attempt";
    EXPECT_EQ(stored().summary.poses, static_cast<long long>(kSteps));
    expect_safe_state();
    fs::remove(database());
    fs::remove(database().string() + "-wal");
    fs::remove(database().string() + "-shm");
  }
}

TEST_F(SequencerPause, AtThePoseComesAfterItsCommit) {
  start_rig();
  const auto session = run_with_pause(Pause::at_pose, EngineState::moving);
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
  EXPECT_EQ(done_when_paused_, 6u);
  EXPECT_THAT(events("pause"), SizeIs(1));
}

TEST_F(SequencerPause, AConditionOutOfItsBandSuspends) {
  configure(std::string(kSmallRig) + R"(
[[suspend]]
column = "rh_pct"
max = 48
hysteresis = 1
delay_s = 0.5
hold_s = 1
)");
  start_rig("\nrh_pct = 45\nrh_cycle_pct = 6\nrh_cycle_period_s = 40\n");
  const auto session = run();
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
  EXPECT_THAT(events("suspend"), Contains(HasSubstr("rh_pct = ")));
  EXPECT_EQ(events("go on").size(), events("suspend").size());
  // Nothing was measured in the damp: the limit, half a second of delay, a reading in between.
  const storage::StoredRun run = stored();
  for (const Covariate& column : run.grid.samples.covariates) {
    for (const double rh : column.value) EXPECT_LT(rh, 49.0);
  }
}

TEST_F(SequencerPause, StopAndAbortWhilePausedEndSafely) {
  for (const bool abort : {false, true}) {
    start_rig();
    EngineControl control;
    const auto session =
        run_session({.rig = rig_, .database = database()}, control, [&](const Progress& progress) {
          if (progress.step == 3) control.request_pause(Pause::now);
          if (progress.state == EngineState::paused) {
            if (abort) {
              control.request_abort();
            } else {
              control.request_stop();
            }
          }
        });
    ASSERT_TRUE(session.has_value()) << session.error().message;
    ASSERT_FALSE(session->outcome.has_value());
    EXPECT_EQ(stored(session->run).summary.state, RunState::stopped);
    expect_safe_state();
  }
}

TEST_F(SequencerPause, EveryStateIsStoppedSafely) {
  for (const EngineState at : {EngineState::homing, EngineState::moving, EngineState::settling,
                               EngineState::sampling, EngineState::recovering}) {
    start_rig("\n[[faults]]\nkind = \"drive.alarm\"\naxis = \"h\"\nmove = 6\n");
    EngineControl control;
    const auto session =
        run_session({.rig = rig_, .database = database()}, control, [&](const Progress& progress) {
          if (progress.state == at) control.request_stop();
        });
    ASSERT_TRUE(session.has_value()) << session.error().message;
    ASSERT_FALSE(session->outcome.has_value()) << to_string(at);
    EXPECT_THAT(session->outcome.error().message, HasSubstr("stopped on request"));
    EXPECT_EQ(stored(session->run).summary.state, RunState::stopped);
    if (at != EngineState::recovering) expect_safe_state();  // there the alarm is still on
  }
}

TEST_F(SequencerPause, AFullDiskLeavesTheMotorsSafeAndTheRunResumable) {
  start_rig();
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  bool full = false;
  const auto session = run(false, [&](const Progress& progress) {
    if (full || progress.done < 5) return;
    full = true;
    const rlimit limited{fs::file_size(database().string() + "-wal"), before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limited);
  });
  setrlimit(RLIMIT_FSIZE, &before);
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_FALSE(session->outcome.has_value());
  EXPECT_EQ(session->outcome.error().code, ErrorCode::storage);
  EXPECT_THAT(session->outcome.error().message, HasSubstr("File too large"));
  expect_safe_state();
  const auto resumed = run(true);
  ASSERT_TRUE(resumed.has_value()) << resumed.error().message;
  ASSERT_TRUE(resumed->outcome.has_value()) << resumed->outcome.error().message;
  EXPECT_EQ(stored().summary.poses, static_cast<long long>(kSteps));
}

}  // namespace
}  // namespace plumbline::app
