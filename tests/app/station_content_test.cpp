// What the station says: the run at hand, the runs before, their statistics, metrics.
#include <chrono>
#include <cmath>
#include <fstream>
#include <thread>

#include "app/io/csv_writer.h"
#include "app/sequencer/control_socket.h"
#include "app/station/running_fit.h"
#include "app/station/statistics.h"
#include "tests/app/program.h"
#include "tests/app/result_example.h"
#include "tests/app/station_fixture.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;

/// Waits until what the station says about the present holds.
nlohmann::json await(const std::function<nlohmann::json()>& look,
                     const std::function<bool(const nlohmann::json&)>& holds) {
  nlohmann::json last;
  for (int i = 0; i < 1000; ++i) {
    last = look();
    if (holds(last)) return last;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  ADD_FAILURE() << last.dump();
  return last;
}

void write_result(const fs::path& folder, const std::string& chain_head, double K_xx,
                  const std::string& decision) {
  fs::create_directories(folder);
  write_text(folder / "result.json", example_result(chain_head, K_xx, decision).dump());
  write_text(folder / "certificate.html", "<!doctype html><title>certificate</title>");
}

TEST_F(StationTest, WithoutARunItIsReady) {
  open();
  EXPECT_EQ(json("/api/live")["phase"], "empty");
  EXPECT_EQ(json("/api/runs")["all"], 0);
  EXPECT_EQ(get("/healthz").status, 200);
}

TEST_F(StationTest, DamagedDatabaseIsNotHealthy) {
  write_text(database(), std::string(8192, 'x'));
  open();
  EXPECT_EQ(get("/healthz").status, 503);
  EXPECT_EQ(get("/api/runs").status, 503);
}

TEST_F(StationTest, FollowsASessionAndOutlivesIt) {
  open_with_control();
  LiveState live({.serial = "A-7",
                  .database = "runs.db",
                  .out = "out",
                  .started_utc = "2026-01-02T03:04:05Z",
                  .rate_hz = 100,
                  .adc = {}});
  EngineControl control;
  auto socket = ControlSocket::open(control_path(database()), live, control).value();
  Progress progress;
  progress.state = EngineState::sampling;
  progress.reason = "pose 3";
  progress.steps = 10;
  progress.planned_total_s = 100;
  progress.planned_done_s = 30;
  progress.newest = RawSample{.counter = 1, .t_s = 1.5, .code = {0, 100, -100}, .temp_C = 21.25};
  live.update(progress);
  const auto look = [&] { return json("/api/live"); };
  // The station may have come before the first progress.
  const auto running = await(look, [](const auto& now) {
    return now["phase"] == "running" && now["status"]["state"] == "sampling";
  });
  EXPECT_EQ(running["status"]["state"], "sampling");
  EXPECT_EQ(running["run"]["serial"], "A-7");
  EXPECT_TRUE(running["verdict"].is_null());
  EXPECT_EQ(json("/api/trace")["trace"][0][4], 21.25);
  EXPECT_THAT(get("/metrics").body, HasSubstr("plumbline_state{state=\"sampling\"} 1\n"));

  EXPECT_EQ(post("/api/order", own_headers(), R"({"order":"pause"})").status, 200);
  EXPECT_EQ(control.pause_requested(), EngineControl::Pause::now);
  EXPECT_EQ(post("/api/order", own_headers(), R"({"order":"resume"})").status, 200);
  EXPECT_EQ(control.pause_requested(), EngineControl::Pause::none);
  EXPECT_EQ(post("/api/order", own_headers(), R"({"order":"abort the mission"})").status, 400);
  EXPECT_EQ(post("/api/start", own_headers(), R"({"serial":"A","operator":"B","plan":"C"})").status,
            409)
      << "one is under way";
  EXPECT_EQ(post("/api/order", own_headers(), R"({"order":"stop"})").status, 200);
  EXPECT_TRUE(control.stop_requested());

  socket.reset();
  await(look, [](const auto& now) { return now["phase"] != "running"; });
}

TEST_F(StationTest, VerdictStaysUntilTheNextStart) {
  const std::string head = record("A-1");
  open();
  EXPECT_EQ(json("/api/live")["run"]["serial"], "A-1");
  write_result(folder_ / "out", head, 0.03, "conditional_pass");
  const auto done = await([&] { return json("/api/live"); },
                          [](const auto& now) { return !now["verdict"].is_null(); });
  EXPECT_EQ(done["phase"], "finished");
  EXPECT_EQ(done["verdict"]["decision"], "conditional_pass");
  EXPECT_THAT(get("/api/events").body, HasSubstr("R. Roe"));
  open();  // started anew
  EXPECT_EQ(json("/api/live")["verdict"]["decision"], "conditional_pass");
}

TEST_F(StationTest, HistoryHasRunsFilesAndStatistics) {
  int index = 0;
  for (const char* serial : {"A-1", "A-2", "G-1", "B-3", "G-1", "A-2"}) {
    const std::string head = record(serial);
    const double Kxx = 0.030 + 0.001 * index;
    write_result(folder_ / std::to_string(index), head, Kxx, index == 1 ? "fail" : "pass");
    ++index;
  }
  StationOptions options;
  options.history.golden = "G-1";
  options.history.tolerances = {{"K_xx", {.lower = 0.02, .upper = 0.05}}};
  open(options);

  EXPECT_EQ(json("/api/runs")["runs"].size(), 6U);
  const auto found = json("/api/runs?serial=a-2");
  ASSERT_EQ(found["total"], 2);
  EXPECT_EQ(found["runs"][0]["id"], 6) << "newest first";
  EXPECT_EQ(found["runs"][1]["result"]["decision"], "fail");
  EXPECT_EQ(json("/api/runs?serial=%27%20OR%201%3D1")["total"], 0);
  EXPECT_EQ(json("/api/runs?most=2")["runs"].size(), 2U);

  EXPECT_THAT(get("/runs/1/certificate.html").head, HasSubstr("sandbox"));
  EXPECT_THAT(get("/runs/1/certificate.html").body, HasSubstr("certificate"));
  EXPECT_EQ(get("/runs/1/certificate.html", "Accept-Encoding: gzip, deflate, br\r\n").body,
            get("/runs/1/certificate.html").body)
      << "the rig's machine has better things to do than to compress";
  const auto stored = storage::RunStore::open_read_only(database())->load(1).value();
  ASSERT_TRUE(write_samples(folder_ / "same.csv", stored.grid));
  const Answer samples = get("/runs/1/samples.csv");
  EXPECT_EQ(samples.body, text_of(folder_ / "same.csv"));
  EXPECT_THAT(samples.head, HasSubstr("attachment; filename=\"run-1-samples.csv\""));
  EXPECT_EQ(get("/runs/1/static.csv").status, 404) << "it has none";

  const auto both = json("/api/compare?a=1&b=2");
  EXPECT_EQ(both["parameters"].size(), 12U);
  EXPECT_NEAR(both["parameters"][0]["E_n"].get<double>(), 0.001 / (2 * std::sqrt(2) * 1e-5), 1e-6);
  EXPECT_EQ(get("/api/compare?a=1&b=77").status, 404);
  EXPECT_EQ(get("/api/compare?a=1").status, 400);

  const auto trends = json("/api/trends");
  const auto& Kxx = trends["units"][0];
  EXPECT_EQ(Kxx["name"], "K_xx");
  ASSERT_EQ(Kxx["points"].size(), 3U) << "A-2 counts once, with its last result; G-1 is apart";
  EXPECT_EQ(Kxx["points"][2]["serial"], "A-2");
  EXPECT_NEAR(Kxx["chart"]["mean"].get<double>(), (0.030 + 0.033 + 0.035) / 3, 1e-12);
  EXPECT_TRUE(Kxx["performance"]["Ppk"].is_number());
  EXPECT_EQ(trends["golden"][0]["points"].size(), 2U);
  EXPECT_EQ(trends["yield"]["units"], 3);
  EXPECT_NEAR(trends["yield"]["first_pass"].get<double>(), 2.0 / 3, 1e-12);
  EXPECT_EQ(trends["yield"]["final"], 1.0);
}

TEST_F(StationTest, PromtoolLikesTheMetrics) {
  if (std::system("command -v promtool >/dev/null") != 0) GTEST_SKIP() << "promtool is missing";
  record("A-1");
  open();
  LiveState live(
      {.serial = "A", .database = "", .out = "", .started_utc = "", .rate_hz = 100, .adc = {}});
  EngineControl control;
  const auto socket = ControlSocket::open(control_path(database()), live, control).value();
  Progress progress;
  progress.newest = RawSample{.counter = 1, .t_s = 1, .code = {}, .temp_C = 20};
  live.update(progress);
  // The station may have come before the first progress.
  await([&] { return nlohmann::json(get("/metrics").body); },
        [](const auto& now) {
          return now.template get<std::string>().find(
                     "plumbline_sensor_temperature_celsius 20\n") != std::string::npos;
        });
  const Answer metrics = get("/metrics");
  EXPECT_THAT(metrics.head, HasSubstr("version=0.0.4"));
  EXPECT_THAT(metrics.body, HasSubstr("plumbline_sensor_temperature_celsius 20\n"));
  write_text(folder_ / "metrics", metrics.body);
  const std::string command = "promtool check metrics < " + (folder_ / "metrics").string() + " > " +
                              (folder_ / "said").string() + " 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << text_of(folder_ / "said");
  EXPECT_EQ(text_of(folder_ / "said"), "") << "no advice either";
}

TEST(Statistics, ControlChartByHand) {
  const auto chart = control_chart({10, 12, 11, 11, 30});
  ASSERT_TRUE(chart.has_value());
  EXPECT_THAT(chart->range, ElementsAre(2, 1, 0, 19));
  EXPECT_NEAR(chart->mean, 14.8, 1e-12);
  EXPECT_NEAR(chart->mean_range, 5.5, 1e-12);
  EXPECT_NEAR(chart->upper, 14.8 + 2.66 * 5.5, 1e-12);
  EXPECT_NEAR(chart->lower, 14.8 - 2.66 * 5.5, 1e-12);
  EXPECT_NEAR(chart->upper_range, 3.267 * 5.5, 1e-12);
  EXPECT_THAT(chart->outside, ElementsAre(4));
  EXPECT_FALSE(control_chart({1}).has_value());
}

TEST(Statistics, PerformanceByHand) {
  const auto found = performance({1, 2, 3}, {.lower = 0, .upper = 5});
  ASSERT_TRUE(found.has_value());
  EXPECT_DOUBLE_EQ(found->s, 1);
  EXPECT_DOUBLE_EQ(found->Pp.value(), 5.0 / 6);
  EXPECT_DOUBLE_EQ(found->Ppk.value(), 2.0 / 3);
  const auto one_sided = performance({1, 2, 3}, {.lower = {}, .upper = 5});
  EXPECT_FALSE(one_sided->Pp.has_value());
  EXPECT_DOUBLE_EQ(one_sided->Ppk.value(), 1);
  EXPECT_FALSE(performance({2, 2}, {.lower = 0, .upper = 5})->Ppk.has_value());
  EXPECT_NEAR(normalized_error(3, 0.3, 1, 0.4), 2.0, 1e-12);
}

TEST(RunningFit, FindsTheParametersOfACleanUnit) {
  std::vector<PoseMean> poses;
  const double rad = std::acos(-1.0) / 180;
  for (int delta = 0; delta < 360; delta += 40) {
    for (const int h : {0, 30, 60}) {
      const double a[3] = {std::cos(h * rad) * std::cos(delta * rad),
                           -std::cos(h * rad) * std::sin(delta * rad), std::sin(h * rad)};
      PoseMean pose;
      pose.target = {static_cast<double>(delta), static_cast<double>(h)};
      pose.samples = 10;
      pose.sd_V = {1e-4, 1e-4, 1e-4};
      pose.mean_V = {0.03 * a[0] + 0.001 * a[1] - 2.5, 0.032 * a[1] - 2.4, -0.033 * a[2] - 2.3};
      poses.push_back(pose);
    }
  }
  EXPECT_FALSE(running_fit({poses.begin(), poses.begin() + 4}, 1).has_value());
  const auto fit = running_fit(poses, 1);
  ASSERT_TRUE(fit.has_value());
  EXPECT_NEAR((*fit)[0].value[1], 0.001, 1e-12);
  EXPECT_NEAR((*fit)[2].value[2], -0.033, 1e-12);
  EXPECT_LT((*fit)[0].rms_mps2, 1e-9);
  poses[5].mean_V[2] -= 0.033 * 0.1;  // reads 0.1 g too much
  const auto bent = running_fit(poses, 1);
  EXPECT_THAT((*bent)[2].residual_mps2[5], DoubleNear(0.98, 0.3));
  EXPECT_NEAR(pooled_sd_V(poses)[0], 1e-4, 1e-15);
}

TEST(ServeCommand, RefusesWhatIsNotSafe) {
  const ProgramOutcome open =
      run_plumbline({"serve", "--db", "/tmp/none.db", "--listen", "0.0.0.0:0"});
  EXPECT_EQ(open.exit_code, 2);
  EXPECT_THAT(open.err, HasSubstr("--token-file"));
  EXPECT_EQ(open.error_lines(), 1);
  EXPECT_EQ(run_plumbline({"serve", "--db", "x", "--listen", "nowhere"}).exit_code, 2);
  EXPECT_EQ(run_plumbline(
                {"run", "--config", "c", "--serial", "s", "--db", "d", "--out", "o", "--control"})
                .exit_code,
            2)
      << "control of what?";
}

}  // namespace
}  // namespace plumbline::app
