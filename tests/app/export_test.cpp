// `plumbline runs` and `plumbline export` as processes, on a real database.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "app/io/csv.h"
#include "storage/run_store.h"
#include "tests/app/program.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

using storage::PoseKind;
using storage::PoseRecord;
using storage::RunStore;
using testing::HasSubstr;

class ExportTest : public testing::Test {
 protected:
  ExportTest() : store_(std::move(RunStore::open(folder_ / "runs.db").value())) {
    run_ = store_
               .create_run({.serial = "A-0017",
                            .program_version = "0.1.0",
                            .config_toml = "[dut]\nserial = \"A-0017\"\n",
                            .plan_csv = "",
                            .started_utc = "2026-01-02T03:04:05Z",
                            .rate_hz = 100,
                            .adc = {.bits = 16, .min_V = -5, .max_V = 0}})
               .value();
  }

  void record(long long ordinal, PoseKind kind) {
    PoseRecord pose;
    pose.ordinal = ordinal;
    pose.kind = kind;
    pose.delta_deg = 10.0 * static_cast<double>(ordinal);
    pose.delta_enc_deg = pose.delta_deg + 0.1;
    for (int i = 0; i < 3; ++i) {
      RawSample sample;
      sample.counter = ordinal * 10 + i;
      sample.t_s = static_cast<double>(ordinal) + i / 300.0;
      sample.code = {i, 1000 + i, -i};
      sample.temp_C = 20.1;
      pose.samples.push_back(sample);
    }
    pose.covariates = {{"rh_pct", static_cast<double>(ordinal), 40.3}};
    ASSERT_TRUE(store_.commit_pose(run_, pose));
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  TempFolder folder_;
  RunStore store_;
  storage::RunId run_ = 0;
};

TEST_F(ExportTest, FilesHoldTheSameNumbersAsTheDatabase) {
  record(0, PoseKind::soak);
  record(1, PoseKind::grid);
  record(2, PoseKind::grid);
  record(3, PoseKind::verification);
  const auto outcome = run_plumbline(
      {"export", "--db", path("runs.db"), "--run", "1", "--out", path("samples.csv"), "--static",
       path("static.csv"), "--confirm", path("confirm.csv"), "--config", path("run.toml")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("run 1 (A-0017, running): 2 poses, 6 samples to"));
  EXPECT_EQ(text_of(folder_ / "run.toml"), "[dut]\nserial = \"A-0017\"\n");
  EXPECT_THAT(text_of(folder_ / "samples.csv"),
              testing::StartsWith("t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V,delta_enc_deg,h_enc_deg,"
                                  "temp_C,rh_pct\n1,0,10,0,-2.5,"));

  const auto stored = store_.load(run_).value();
  const auto same = [](const SampleTable& a, const SampleTable& b) {
    EXPECT_EQ(a.t_s, b.t_s);
    EXPECT_EQ(a.u_V, b.u_V);
    EXPECT_EQ(a.temp_C, b.temp_C);
    EXPECT_EQ(a.delta_enc_deg, b.delta_enc_deg);
    EXPECT_EQ(a.h_enc_deg, b.h_enc_deg);
    ASSERT_EQ(a.covariates.size(), 1u);
    ASSERT_EQ(b.covariates.size(), 1u);
    EXPECT_EQ(a.covariates[0].value, b.covariates[0].value);
  };
  const auto grid = read_samples(folder_ / "samples.csv").value();
  same(grid.samples, stored.grid.samples);
  ASSERT_EQ(grid.poses.size(), 2u);
  EXPECT_EQ(grid.poses[1].number, 1);
  EXPECT_EQ(grid.poses[1].delta_deg, 20);
  same(read_samples(folder_ / "confirm.csv").value().samples, stored.verification.samples);
  same(read_static(folder_ / "static.csv").value().samples, stored.soak);
}

TEST_F(ExportTest, WhatIsNotThereIsSaidAndNothingIsWritten) {
  const auto empty = run_plumbline(
      {"export", "--db", path("runs.db"), "--run", "1", "--out", path("samples.csv")});
  EXPECT_EQ(empty.exit_code, 2);
  EXPECT_THAT(empty.err, HasSubstr("run 1 has no pose of the grid"));
  record(1, PoseKind::grid);
  const auto soak = run_plumbline({"export", "--db", path("runs.db"), "--run", "1", "--out",
                                   path("samples.csv"), "--static", path("static.csv")});
  EXPECT_EQ(soak.exit_code, 2);
  EXPECT_THAT(soak.err, HasSubstr("run 1 has no static record; leave out --static"));
  const auto unknown = run_plumbline(
      {"export", "--db", path("runs.db"), "--run", "7", "--out", path("samples.csv")});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_EQ(unknown.error_lines(), 1);
  EXPECT_THAT(unknown.err, HasSubstr("there is no run 7"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "samples.csv"));
  const auto full =
      run_plumbline({"export", "--db", path("runs.db"), "--run", "1", "--out", "/dev/full"});
  EXPECT_EQ(full.exit_code, 2);
  EXPECT_THAT(full.err, HasSubstr("/dev/full: cannot write: No space left on device"));
}

TEST_F(ExportTest, RunsAreListedForPeopleAndPrograms) {
  record(1, PoseKind::grid);
  ASSERT_TRUE(store_.finish_run(run_, storage::RunState::finished, "2026-01-02T04:00:00Z"));
  const auto table = run_plumbline({"runs", "--db", path("runs.db")});
  EXPECT_EQ(table.exit_code, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("   1  2026-01-02T03:04:05Z  A-0017            finished      1"
                                   "          3\n"));
  const auto list = run_plumbline({"runs", "--db", path("runs.db"), "--json"});
  const auto json = nlohmann::json::parse(list.out);
  EXPECT_EQ(json["schema"], "plumbline.runs/1");
  EXPECT_EQ(json["runs"][0]["id"], 1);
  EXPECT_EQ(json["runs"][0]["state"], "finished");
  EXPECT_EQ(json["runs"][0]["samples"], 3);

  const auto absent = run_plumbline({"runs", "--db", path("none.db")});
  EXPECT_EQ(absent.exit_code, 2);
  EXPECT_EQ(absent.error_lines(), 1);
  EXPECT_THAT(absent.err, HasSubstr("none.db: there is no such database file"));
}

}  // namespace
}  // namespace plumbline::app
