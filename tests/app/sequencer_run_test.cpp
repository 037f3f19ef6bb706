// Whole runs against the real simulated rig: its own process, Modbus over TCP, CAN frames over a
// Unix socket, an SQLite file.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <numeric>
#include <string>
#include <thread>

#include "app/sequencer/separation_plan.h"
#include "tests/app/sequencer_fixture.h"

namespace plumbline::app {
namespace {

using storage::PoseKind;
using storage::RunState;
using testing::HasSubstr;

void expect_complete(const storage::StoredRun& run) {
  EXPECT_EQ(run.summary.state, RunState::finished);
  EXPECT_EQ(run.summary.poses, static_cast<long long>(kSteps));
  EXPECT_EQ(run.soak.size(), 2000u);
  ASSERT_EQ(run.grid.poses.size(), 12u);
  ASSERT_EQ(run.verification.poses.size(), 2u);
  EXPECT_EQ(run.grid.samples.size(), 240u);
  // Snake: 0, 90, 180, 270, then back.
  EXPECT_EQ(run.grid.poses[0].delta_deg, 0);
  EXPECT_EQ(run.grid.poses[4].delta_deg, 270);
  EXPECT_EQ(run.grid.poses[4].h_deg, 20);
  EXPECT_EQ(run.grid.poses[11].delta_deg, 270);
  EXPECT_EQ(run.grid.poses[11].h_deg, 40);
  for (const Pose& pose : run.grid.poses) {
    EXPECT_EQ(pose.count, 20u);
    EXPECT_NEAR(run.grid.samples.delta_enc_deg[pose.first], pose.delta_deg, 0.005);
    EXPECT_NEAR(run.grid.samples.h_enc_deg[pose.first], pose.h_deg, 0.005);
    for (std::size_t i = pose.first + 1; i < pose.first + pose.count; ++i)
      EXPECT_NEAR(run.grid.samples.t_s[i] - run.grid.samples.t_s[i - 1], 0.01, 1e-6);
  }
}

TEST_F(SequencerRun, MeasuresThePlanIntoTheDatabase) {
  start_rig();
  const auto session = run();
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
  const storage::StoredRun run = stored();
  expect_complete(run);
  EXPECT_EQ(run.summary.header.config_toml, kSmallRig);
  // At rest before the first sample: the means differ between poses by far more than the samples
  // within one, whose scatter is the 0.3 mV of the world.
  const auto& ux = run.grid.samples.u_V[0];
  for (const Pose& pose : run.grid.poses) {
    const auto first = ux.begin() + static_cast<std::ptrdiff_t>(pose.first);
    const auto last = first + static_cast<std::ptrdiff_t>(pose.count);
    const double mean = std::accumulate(first, last, 0.0) / 20;
    double square = 0;
    for (auto u = first; u != last; ++u) square += (*u - mean) * (*u - mean) / 19;
    EXPECT_LT(std::sqrt(square), 0.0006);
    EXPECT_GT(std::sqrt(square), 0.0001);
  }
  ASSERT_FALSE(run.events.empty());
  EXPECT_THAT(run.events.front().text, HasSubstr("idle"));
  EXPECT_THAT(run.events.back().text, HasSubstr("finished"));
  expect_motors_at_rest();
}

TEST_F(SequencerRun, StopsOnRequestAndResumes) {
  start_rig();
  const auto stopped = run(false, [this](const Progress& progress) {
    if (progress.step == 6 && progress.state == EngineState::moving) control_.request_stop();
  });
  ASSERT_TRUE(stopped.has_value()) << stopped.error().message;
  ASSERT_FALSE(stopped->outcome.has_value());
  EXPECT_EQ(stopped->outcome.error().code, ErrorCode::rig);
  EXPECT_THAT(stopped->outcome.error().message, HasSubstr("stopped on request"));
  expect_motors_at_rest();
  storage::StoredRun half = stored();
  EXPECT_EQ(half.summary.state, RunState::stopped);
  EXPECT_EQ(half.summary.poses, 6);

  // The clock of a resumed run goes on although the node restarts.
  simulated_.reset();
  start_rig();
  EngineControl go_on;
  const auto resumed =
      run_session({.rig = rig_, .database = database(), .resume = true}, go_on, {});
  ASSERT_TRUE(resumed.has_value()) << resumed.error().message;
  ASSERT_TRUE(resumed->outcome.has_value()) << resumed->outcome.error().message;
  EXPECT_EQ(resumed->run, stopped->run);
  const storage::StoredRun whole = stored();
  expect_complete(whole);
  for (std::size_t i = 1; i < whole.grid.samples.size(); ++i)
    ASSERT_GT(whole.grid.samples.t_s[i], whole.grid.samples.t_s[i - 1]);

  const auto again = run_session({.rig = rig_, .database = database(), .resume = true}, go_on, {});
  ASSERT_FALSE(again.has_value());
  EXPECT_EQ(again.error().code, ErrorCode::input);
  EXPECT_THAT(again.error().message, HasSubstr("is finished"));

  // One whose power was cut before there was a result is gone on with; nothing is left to measure.
  SessionRequest late{.rig = rig_, .database = database(), .out = folder_, .resume = true};
  const auto to_calibrate = run_session(late, go_on, {});
  ASSERT_TRUE(to_calibrate.has_value()) << to_calibrate.error().message;
  EXPECT_TRUE(to_calibrate->outcome.has_value());
  EXPECT_EQ(to_calibrate->run, stopped->run);
  EXPECT_EQ(stored().events.size(), whole.events.size());
  std::ofstream(folder_ / "result.json") << "{}";
  EXPECT_THAT(run_session(late, go_on, {}).error().message, HasSubstr("is finished"));
}

TEST_F(SequencerRun, GoesOnWithFurtherPosesInTheSameRun) {
  constexpr const char* kReason =
      "sensor.quadratic, or sensor.cubic: 2 further poses in random order (h from -10° to 10°) "
      "tell it from sensor.cubic by 6.0 standard deviations";
  start_rig();
  int asked = 0;
  SessionRequest request{.rig = rig_, .database = database()};
  request.further = [&](storage::RunId run) -> Result<FurtherSteps> {
    ++asked;
    EXPECT_EQ(run, 1);
    EXPECT_EQ(stored().grid.poses.size(), 12u);  // what was measured can be looked at
    return FurtherSteps{{{0, storage::PoseKind::grid, {45, 10}, {}, 20},
                         {1, storage::PoseKind::grid, {135, -10}, {}, 40}},
                        {kReason}};
  };
  const auto session = run_session(request, control_, {});
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
  EXPECT_EQ(asked, 1);
  const storage::StoredRun run = stored();
  EXPECT_EQ(run.summary.state, RunState::finished);
  ASSERT_EQ(run.grid.poses.size(), 14u);
  EXPECT_EQ(run.verification.poses.size(), 2u);
  EXPECT_EQ(run.grid.poses[12].delta_deg, 45);
  EXPECT_EQ(run.grid.poses[13].h_deg, -10);
  EXPECT_EQ(run.grid.poses[13].count, 40u);
  for (std::size_t i = 1; i < run.grid.samples.size(); ++i)
    ASSERT_GT(run.grid.samples.t_s[i], run.grid.samples.t_s[i - 1]);
  EXPECT_THAT(events("separate"), testing::ElementsAre(HasSubstr("2 further poses")));
  EXPECT_THAT(events("found so far"), testing::ElementsAre(kReason));
  expect_motors_at_rest();
}

TEST_F(SequencerRun, ResumesAmongFurtherPoses) {
  start_rig();
  std::vector<std::size_t> seen;
  SessionRequest request{.rig = rig_, .database = database()};
  request.further = [&](storage::RunId) -> Result<FurtherSteps> {
    seen.push_back(stored().grid.poses.size());
    if (seen.back() >= 15) return FurtherSteps{};
    return FurtherSteps{{{0, storage::PoseKind::grid, {45, 10}, {}, 20},
                         {1, storage::PoseKind::grid, {135, -10}, {}, 20}}};
  };
  int further_moves = 0;
  const auto stopped = run_session(request, control_, [&](const Progress& progress) {
    if (progress.state != EngineState::moving || progress.steps <= kSteps) return;
    if (progress.step > kSteps) control_.request_stop();  // the second of the further ones
    ++further_moves;
  });
  ASSERT_TRUE(stopped.has_value()) << stopped.error().message;
  ASSERT_FALSE(stopped->outcome.has_value());
  EXPECT_GT(further_moves, 0);
  EXPECT_EQ(stored().grid.poses.size(), 13u);

  // Nothing of the plan is measured again but the three poses that are compared.
  request.resume = true;
  EngineControl go_on;
  const auto resumed = run_session(request, go_on, {});
  ASSERT_TRUE(resumed.has_value()) << resumed.error().message;
  ASSERT_TRUE(resumed->outcome.has_value()) << resumed->outcome.error().message;
  const storage::StoredRun run = stored();
  EXPECT_EQ(run.summary.state, RunState::finished);
  ASSERT_EQ(run.grid.poses.size(), 15u);
  EXPECT_EQ(run.verification.poses.size(), 2u);
  EXPECT_EQ(run.grid.poses[13].delta_deg, 45);
  EXPECT_EQ(run.grid.poses[14].h_deg, -10);
  EXPECT_EQ(seen, (std::vector<std::size_t>{12, 13}));
  EXPECT_THAT(events("check"), testing::Contains(HasSubstr("3 earlier poses")));
  expect_motors_at_rest();

  // It is through now, also for whoever asks for further poses.
  EXPECT_THAT(run_session(request, go_on, {}).error().message, HasSubstr("is finished"));
}

TEST_F(SequencerRun, ResumedWithoutFurtherPosesARunAmongThemEnds) {
  start_rig();
  SessionRequest request{.rig = rig_, .database = database()};
  request.further = [](storage::RunId) -> Result<FurtherSteps> {
    return FurtherSteps{{{0, storage::PoseKind::grid, {45, 10}, {}, 20}}};
  };
  const auto stopped = run_session(request, control_, [&](const Progress& progress) {
    if (progress.steps > kSteps) control_.request_stop();
  });
  ASSERT_TRUE(stopped.has_value()) << stopped.error().message;
  ASSERT_FALSE(stopped->outcome.has_value());
  EngineControl go_on;
  const auto ended = run_session({.rig = rig_, .database = database(), .resume = true}, go_on, {});
  ASSERT_TRUE(ended.has_value()) << ended.error().message;
  ASSERT_TRUE(ended->outcome.has_value()) << ended->outcome.error().message;
  expect_complete(stored());
}

TEST_F(SequencerRun, ResumesAFinishedPlanForFurtherPoses) {
  start_rig();
  ASSERT_TRUE(run().has_value());
  SessionRequest request{.rig = rig_, .database = database(), .resume = true};
  request.further = [](storage::RunId) -> Result<FurtherSteps> {
    return FurtherSteps{{{0, storage::PoseKind::grid, {45, 10}, {}, 20}}};
  };
  const auto resumed = run_session(request, control_, {});
  ASSERT_TRUE(resumed.has_value()) << resumed.error().message;
  ASSERT_TRUE(resumed->outcome.has_value()) << resumed->outcome.error().message;
  EXPECT_EQ(stored().grid.poses.size(), 13u);
  EXPECT_EQ(stored().summary.state, RunState::finished);
}

TEST_F(SequencerRun, RunsAPlanFromAFile) {
  start_rig();
  const auto plan = plan_from_csv(
      "ordinal,kind,delta_deg,h_deg,samples,via\n0,grid,10,5,20,\n1,grid,20,5,20,15:5\n", "p.csv");
  ASSERT_TRUE(plan.has_value()) << plan.error().message;
  rig_.settling.noise_V = 3e-4;  // no soak to learn it from
  const auto session =
      run_session({.rig = rig_, .database = database(), .plan = *plan}, control_, {});
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_TRUE(session->outcome.has_value()) << session->outcome.error().message;
  EXPECT_EQ(stored().grid.poses.size(), 2u);
  EXPECT_EQ(stored().summary.header.plan_csv, to_csv(*plan));
}

TEST_F(SequencerRun, RefusesToResumeAnotherPlan) {
  start_rig();
  control_.request_stop();
  ASSERT_TRUE(run().has_value());
  rig_.plan.samples_per_pose = 21;
  const auto refused = run(true);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::input);
  EXPECT_THAT(refused.error().message, HasSubstr("another plan"));
  rig_.plan.samples_per_pose = 20;
  rig_.source += "# edited\n";
  EXPECT_THAT(run(true).error().message, HasSubstr("another configuration"));
  rig_.run.dut.serial = "OTHER";
  EXPECT_THAT(run(true).error().message, HasSubstr("no run of OTHER"));
}

TEST_F(SequencerRun, RefusesAPlanBeyondTheDrivesLimits) {
  rig_.plan.order = VisitOrder::spiral;
  start_rig();
  const auto session = run();
  ASSERT_TRUE(session.has_value()) << session.error().message;
  ASSERT_FALSE(session->outcome.has_value());
  EXPECT_EQ(session->outcome.error().code, ErrorCode::input);
  EXPECT_THAT(session->outcome.error().message, HasSubstr("above the soft limit of 369°"));
}

/// Runs to failure and returns how; the run must be closed in an intact database within a minute.
std::string failure(const Result<Session>& session, std::chrono::steady_clock::time_point start) {
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
  EXPECT_TRUE(session.has_value());
  if (!session) return session.error().message;
  EXPECT_FALSE(session->outcome.has_value());
  if (session->outcome) return "";
  EXPECT_EQ(session->outcome.error().code, ErrorCode::rig);
  return session->outcome.error().message;
}

TEST_F(SequencerRun, ModbusAbsent) {
  start_rig();
  rig_.head.modbus = "tcp:127.0.0.1:1";
  const auto start = std::chrono::steady_clock::now();
  const std::string message = failure(run(), start);
  EXPECT_THAT(message, HasSubstr("tcp:127.0.0.1:1"));
  EXPECT_EQ(stored().summary.state, RunState::failed);
}

TEST_F(SequencerRun, WrongUnitId) {
  start_rig();
  rig_.head.unit_id = {9, 9};
  rig_.head.response_timeout = milliseconds{300};
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(failure(run(), start), HasSubstr("9"));
  EXPECT_EQ(stored().summary.state, RunState::failed);
}

TEST_F(SequencerRun, RigStandsStill) {
  start_rig();
  rig_.sensor.silence_timeout = milliseconds{500};
  rig_.head.response_timeout = milliseconds{300};
  bool halted = false;
  const auto start = std::chrono::steady_clock::now();
  const auto session = run(false, [&](const Progress& progress) {
    if (progress.step < 3 || halted) return;
    halted = kill(simulated_->process(), SIGSTOP) == 0;
  });
  kill(simulated_->process(), SIGCONT);
  // A rig that stands still is silent on both wires; whichever is noticed first is named.
  EXPECT_FALSE(failure(session, start).empty());
  const storage::StoredRun run = stored();
  EXPECT_EQ(run.summary.state, RunState::failed);
  EXPECT_EQ(run.summary.poses, 3);
}

}  // namespace
}  // namespace plumbline::app
