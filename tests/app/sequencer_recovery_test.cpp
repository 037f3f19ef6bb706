// What goes wrong on the way and what becomes of it: the run goes on, nothing wrong is accepted,
// and the events say what happened.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/app/sequencer_fixture.h"

namespace plumbline::app {
namespace {

using storage::RunState;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class SequencerRecovery : public SequencerRun {
 protected:
  void SetUp() override {
    SequencerRun::SetUp();
    rig_.sensor.silence_timeout = milliseconds{300};
    rig_.recovery.wait_s = 60;
  }
  void expect_finished(const Result<Session>& session) {
    ASSERT_TRUE(session.has_value()) << session.error().message;
    ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
    const storage::StoredRun run = stored();
    EXPECT_EQ(run.summary.state, RunState::finished);
    EXPECT_EQ(run.grid.poses.size(), 12u);
    EXPECT_EQ(run.verification.poses.size(), 2u);
    expect_safe_state();
    auto store = storage::RunStore::open_read_only(database());
    EXPECT_THAT(store->check_chain(1).value().faults, IsEmpty());
  }
  /// Mean output x by position of the grid, as a run over good wires gives it.
  static std::vector<double> means(const storage::StoredRun& run) {
    std::vector<std::pair<std::pair<double, double>, double>> by_position;
    for (const Pose& pose : run.grid.poses) {
      double mean = 0;
      for (std::size_t i = 0; i < pose.count; ++i) {
        mean += run.grid.samples.u_V[0][pose.first + i] / static_cast<double>(pose.count);
      }
      by_position.push_back({{pose.h_deg, pose.delta_deg}, mean});
    }
    std::sort(by_position.begin(), by_position.end());
    std::vector<double> result;
    for (const auto& entry : by_position) result.push_back(entry.second);
    return result;
  }
};

std::string fault(const std::string& kind, const std::string& rest) {
  return fmt::format("\n[[faults]]\nkind = \"{}\"\n{}\n", kind, rest);
}

TEST_F(SequencerRecovery, TenSecondsOfSilenceOnTheSensorBus) {
  start_rig(fault("can.silence", "move = 6\nduration_s = 80"));
  expect_finished(run());
  EXPECT_THAT(events("fault"), Contains(HasSubstr("the sensor is heard again")));
  EXPECT_THAT(events("retry"), Contains(HasSubstr("no sample for")));
}

TEST_F(SequencerRecovery, ARigThatStandsStillForAWhile) {
  start_rig();
  bool halted = false;
  std::thread wake;
  const auto session = run(false, [&](const Progress& progress) {
    if (progress.step < 3 || halted) return;
    halted = kill(simulated_->process(), SIGSTOP) == 0;
    wake = std::thread([this] {
      std::this_thread::sleep_for(milliseconds{1200});
      kill(simulated_->process(), SIGCONT);
    });
  });
  wake.join();
  expect_finished(session);
  EXPECT_THAT(events("retry"), Not(IsEmpty()));
}

TEST_F(SequencerRecovery, ADriveThatDoesNotAnswerAtOnceWhenTheRunStarts) {
  start_rig(fault("modbus.exception", "code = 6\nafter = 1") + fault("modbus.reset", "after = 5"));
  expect_finished(run());
  EXPECT_THAT(events("retry"), Contains(HasSubstr("start, attempt 1")));
  EXPECT_THAT(events("identity"), testing::SizeIs(1));
}

TEST_F(SequencerRecovery, ARigThatIsNotThereYetWhenARunGoesOn) {
  start_rig();
  const auto stopped = run(false, [&](const Progress& progress) {
    if (progress.step == 3) control_.request_stop();
  });
  ASSERT_FALSE(stopped->outcome.has_value());
  rig_.recovery.wait_s = 60;
  rig_.head.response_timeout = milliseconds{300};
  EngineControl control;
  ASSERT_EQ(kill(simulated_->process(), SIGSTOP), 0);
  std::thread wake([this] {
    std::this_thread::sleep_for(milliseconds{1500});
    kill(simulated_->process(), SIGCONT);
  });
  const auto session =
      run_session({.rig = rig_, .database = database(), .resume = true}, control, {});
  wake.join();
  expect_finished(session);
  EXPECT_THAT(events("retry"), Contains(HasSubstr("start")));
}

TEST_F(SequencerRecovery, EveryFaultOfTheDriveIsSurvived) {
  start_rig(fault("drive.stall", "axis = \"delta\"\nmove = 3\ndelay_s = 0.3") +
            fault("drive.alarm", "axis = \"h\"\ncode = 0x28\nmove = 6\ndelay_s = 0.1") +
            fault("drive.limit", "axis = \"delta\"\nmove = 9\ndelay_s = 0.2") +
            fault("drive.lost_homing", "axis = \"h\"\nmove = 12"));
  expect_finished(run());
  EXPECT_THAT(events("retry"), Contains(HasSubstr("10h following error")));
  EXPECT_THAT(events("retry"), Contains(HasSubstr("28h encoder")));
  EXPECT_THAT(events("retry"), Contains(HasSubstr("60h limit switch")));
  EXPECT_THAT(events("retry"), Contains(HasSubstr("lost its homing")));
  EXPECT_THAT(events("check"), Contains(HasSubstr("agrees")));
  EXPECT_THAT(events("suspect"), IsEmpty());
}

TEST_F(SequencerRecovery, PosesMeasuredAfterASlipAreMeasuredAgain) {
  start_rig();
  ASSERT_TRUE(run()->outcome.has_value());
  const std::vector<double> right = means(stored());
  fs::remove(database());
  fs::remove(database().string() + "-wal");
  fs::remove(database().string() + "-shm");
  start_rig(fault("drive.slip", "axis = \"delta\"\nslip_deg = 8\nmove = 6") +
            fault("drive.lost_homing", "axis = \"delta\"\nmove = 9"));
  expect_finished(run());
  EXPECT_THAT(events("suspect"), Not(IsEmpty()));
  EXPECT_LT(events("suspect").size(), 8u) << "those before the slip are kept";
  const std::vector<double> found = means(stored());
  ASSERT_EQ(found.size(), right.size());
  // 8° turn 4 mV of the 32 mV/g; noise of a mean of 20 samples: 0.07 mV.
  for (std::size_t i = 0; i < right.size(); ++i) EXPECT_NEAR(found[i], right[i], 5e-4) << i;
}

TEST_F(SequencerRecovery, ASoakDuringWhichTheShaftSlipsIsMeasuredAgain) {
  start_rig(fault("drive.slip", "axis = \"delta\"\nslip_deg = 8\nmove = 0\ndelay_s = 10") +
            fault("drive.lost_homing", "axis = \"delta\"\nmove = 3"));
  expect_finished(run());
  EXPECT_THAT(events("suspect"), Contains(testing::StartsWith("pose 0 is taken out")));
  const storage::StoredRun run = stored();
  const std::vector<double>& u_V = run.soak.u_V[0];
  ASSERT_EQ(u_V.size(), 2000u);
  // 8° turn 4 mV of the 32 mV/g; noise of a mean of 1000 samples: 0.003 mV.
  EXPECT_NEAR(std::reduce(u_V.begin(), u_V.begin() + 1000) / 1000,
              std::reduce(u_V.begin() + 1000, u_V.end()) / 1000, 1e-4);
}

TEST_F(SequencerRecovery, AConverterThatHangsAndOneThatIsOverdrivenAreNotBelieved) {
  // Each lasts far longer than the way to the pose, which a busy machine draws out.
  rig_.recovery.attempts_per_pose = 12;
  start_rig(fault("can.stuck_code", "axis = \"y\"\nmove = 4\nduration_s = 60") +
            fault("can.saturation", "axis = \"x\"\nmove = 9\nduration_s = 60"));
  expect_finished(run());
  EXPECT_THAT(events("retry"), Contains(HasSubstr("the converter hangs")));
  EXPECT_THAT(events("retry"), Contains(HasSubstr("end of the converter's span")));
  const storage::StoredRun run = stored();
  for (const double u : run.grid.samples.u_V[0]) EXPECT_LT(u, -0.01);
}

TEST_F(SequencerRecovery, AConverterThatComesBackAmongTheSamplesIsNotBelieved) {
  // It hangs on every third way, and comes back here before, there while the samples are taken,
  // which takes 3 s.
  rig_.recovery.attempts_per_pose = 12;
  rig_.plan.samples_per_pose = 300;
  std::string faults;
  for (int move = 1; move < 24; move += 3) {
    faults += fault("can.stuck_code", fmt::format("axis = \"x\"\nmove = {}\nduration_s = {}", move,
                                                  3.5 + 0.1 * move));
  }
  start_rig(faults);
  expect_finished(run());
  EXPECT_THAT(events("retry"), Contains(HasSubstr("the converter hangs")));
  const storage::StoredRun run = stored();
  for (const Pose& pose : run.grid.poses) {
    const auto first = run.grid.samples.u_V[0].begin() + static_cast<std::ptrdiff_t>(pose.first);
    const auto [low, high] =
        std::minmax_element(first, first + static_cast<std::ptrdiff_t>(pose.count));
    EXPECT_LT(*high - *low, 0.01) << "pose " << pose.number;
  }
}

TEST_F(SequencerRecovery, APoseThatCannotBeReachedIsPutOffAndThenMeasured) {
  // With one attempt only, a busy machine must not look like a fault.
  rig_.recovery.attempts_per_pose = 1;
  rig_.sensor.silence_timeout = milliseconds{10000};
  rig_.head.response_timeout = milliseconds{10000};
  start_rig(fault("drive.stall", "axis = \"delta\"\nmove = 3\nduration_s = 2"));
  expect_finished(run());
  EXPECT_THAT(events("put off"), Contains(HasSubstr("tried again at the end")));
  EXPECT_THAT(events("left out"), IsEmpty());
}

TEST_F(SequencerRecovery, PosesThatStayOutOfReachAreLeftOutUpToALimit) {
  start_rig(fault("drive.stall", "axis = \"delta\"\nmove = 12\ncount = 1000000"));
  rig_.recovery.skipped_poses = 20;
  rig_.recovery.attempts_per_pose = 1;
  const auto session = run();
  ASSERT_TRUE(session.has_value());
  ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
  EXPECT_THAT(events("left out"), Not(IsEmpty()));
  EXPECT_LT(stored().summary.poses, static_cast<long long>(kSteps));
  EXPECT_EQ(stored().summary.state, RunState::finished);

  rig_.recovery.skipped_poses = 1;
  start_rig(fault("drive.stall", "axis = \"delta\"\nmove = 12\ncount = 1000000"));
  const auto second = run();
  ASSERT_TRUE(second.has_value());
  EXPECT_FALSE(second->outcome.has_value());
  EXPECT_EQ(stored(2).summary.state, RunState::failed);
  expect_safe_state();
}

TEST_F(SequencerRecovery, LostAndReorderedFramesNeverReachAPose) {
  start_rig(fault("can.loss", "probability = 0.01") + fault("can.reorder", "probability = 0.01") +
            fault("can.duplicate", "probability = 0.01") +
            fault("can.error_frame", "error_class = 0x40\nat_s = 40"));
  expect_finished(run());
  const storage::StoredRun run = stored();
  for (const Pose& pose : run.grid.poses) {
    for (std::size_t i = pose.first + 1; i < pose.first + pose.count; ++i) {
      ASSERT_NEAR(run.grid.samples.t_s[i] - run.grid.samples.t_s[i - 1], 0.01, 1e-6);
    }
  }
  EXPECT_THAT(events("bus"), Contains(HasSubstr("1 error frames")));
}

// --- resuming ------------------------------------------------------------------------------------

class SequencerResume : public SequencerRecovery {
 protected:
  void stop_half_way(const std::string& world = "") {
    start_rig(world);
    const auto session = run(false, [this](const Progress& progress) {
      if (progress.done == 8) control_.request_stop();
    });
    ASSERT_TRUE(session.has_value()) << session.error().message;
    ASSERT_EQ(stored().summary.state, RunState::stopped);
  }
  Result<Session> resume() {
    EngineControl go_on;
    return run_session({.rig = rig_, .database = database(), .resume = true}, go_on, {});
  }
};

TEST_F(SequencerResume, MeasuresThreeEarlierPosesAgain) {
  stop_half_way();
  start_rig();
  expect_finished(resume());
  EXPECT_THAT(events("check"), Contains(HasSubstr("3 earlier poses measured again agree")));
  auto store = storage::RunStore::open_read_only(database());
  EXPECT_EQ(store->identity(1).value()->drive, "");
}

TEST_F(SequencerResume, RefusesAnotherUnit) {
  stop_half_way();
  start_rig("", 8);  // another unit of the same make
  const auto session = resume();
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_FALSE(session->outcome.has_value());
  EXPECT_THAT(session->outcome.error().message, HasSubstr("cannot be resumed: pose"));
  EXPECT_THAT(session->outcome.error().message, HasSubstr("is it the same unit"));
  EXPECT_EQ(stored().summary.poses, 8);
  expect_safe_state();
}

TEST_F(SequencerResume, RefusesAnotherDriveAndAnotherNode) {
  configure(std::string(kSmallRig) + R"([head]
identity_address = 0x200
identity_count = 4
[sensor]
identity = "IDENT.Serial"
)");
  rig_.head.poll_interval = milliseconds{2};
  stop_half_way();
  auto store = storage::RunStore::open_read_only(database());
  EXPECT_EQ(store->identity(1).value()->drive, "0000-7AB7-0002-0100");  // 31415 = 7AB7h
  EXPECT_EQ(store->identity(1).value()->node, "2718");

  start_rig("\n[drive]\nserial_number = 31416\n");
  auto refused = resume();
  ASSERT_TRUE(refused.has_value()) << refused.error().message;
  EXPECT_THAT(refused->outcome.error().message, HasSubstr("the drive is 0000-7AB8"));
  start_rig("\n[node]\nserial_number = 2719\n");
  refused = resume();
  ASSERT_TRUE(refused.has_value()) << refused.error().message;
  EXPECT_THAT(refused->outcome.error().message, HasSubstr("the node is 2719 and was 2718"));
  EXPECT_EQ(stored().summary.poses, 8);

  start_rig();
  expect_finished(resume());
}

}  // namespace
}  // namespace plumbline::app
