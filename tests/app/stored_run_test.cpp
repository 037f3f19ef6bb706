// A stored run calibrates to the same bytes as the files written from it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "app/io/csv_writer.h"
#include "storage/run_store.h"
#include "tests/app/example_set.h"
#include "tests/app/json_schema.h"
#include "tests/app/program.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using storage::PoseKind;

const std::string kRigToml =
    example_run_toml() +
    "[head]\nmodbus = \"tcp:127.0.0.1:502\"\n[sensor]\ncan = \"can:can0\"\n"
    "bits = 16\nmin_V = -5.0\nmax_V = 0.0\n";

/// A run with a soak, 60 poses of the grid and 8 verification poses, as a rig would have left it.
class StoredRun {
 public:
  explicit StoredRun(const fs::path& file) {
    auto store = storage::RunStore::open(file);
    if (!store) throw std::runtime_error(store.error().message);
    const auto run = store->create_run({.serial = "T-9",
                                        .program_version = "0",
                                        .config_toml = kRigToml,
                                        .plan_csv = "",
                                        .started_utc = "2026-01-31T12:00:00Z",
                                        .rate_hz = 100,
                                        .adc = adc_});
    if (!run) throw std::runtime_error(run.error().message);
    commit(*store, *run, PoseKind::soak, 0, 0, 3000);
    for (int h = 0; h <= 80; h += 20) {
      for (int delta = 0; delta < 360; delta += 30) {
        commit(*store, *run, PoseKind::grid, delta, h, 20);
      }
    }
    for (int i = 0; i < 8; ++i) commit(*store, *run, PoseKind::verification, 41.5 * i, 9.3 * i, 20);
    const auto finished =
        store->finish_run(*run, storage::RunState::finished, "2026-01-31T13:00:00Z");
    if (!finished) throw std::runtime_error(finished.error().message);
  }

 private:
  void commit(storage::RunStore& store, storage::RunId run, PoseKind kind, double delta_deg,
              double h_deg, int samples) {
    storage::PoseRecord pose;
    pose.ordinal = ordinal_++;
    pose.kind = kind;
    pose.delta_deg = pose.delta_enc_deg = delta_deg;
    pose.h_deg = pose.h_enc_deg = h_deg;
    const Eigen::Vector3d volts = truth_.outputs_V(delta_deg, h_deg);
    t_s_ += 2;
    for (int i = 0; i < samples; ++i, t_s_ += 0.01) {
      RawSample sample;
      sample.counter = counter_++;
      sample.t_s = t_s_;
      sample.temp_C = 20 + 0.001 * t_s_;
      for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
        const double u_V = volts[static_cast<Eigen::Index>(axis)] + noise_(engine_);
        sample.code[axis] = static_cast<std::int32_t>(std::lround((u_V + 2.5) / adc_.lsb_V()));
      }
      pose.samples.push_back(sample);
    }
    const auto committed = store.commit_pose(run, pose);
    if (!committed) throw std::runtime_error(committed.error().message);
  }

  const Adc adc_{.bits = 16, .min_V = -5, .max_V = 0};
  const ExampleSet truth_;
  std::mt19937_64 engine_{3};
  std::normal_distribution<double> noise_{0.0, 3e-4};
  long long ordinal_ = 0;
  std::int64_t counter_ = 0;
  double t_s_ = 0;
};

TEST(StoredRunCalibration, EqualsThatOfItsFilesAndEvaluatesTheFreshPoses) {
  const TempFolder folder;
  const StoredRun run(folder / "runs.db");
  const auto from_database =
      run_plumbline({"calibrate", "--run", "1", "--db", folder / "runs.db", "--out", folder / "a"});
  ASSERT_EQ(from_database.exit_code, 0) << from_database.err;
  EXPECT_THAT(from_database.out, testing::HasSubstr("Unit T-9: 60 poses, 1200 samples"));
  EXPECT_THAT(from_database.out, testing::HasSubstr("8 fresh poses"));
  const std::string evaluation = text_of(folder / "a/evaluation.json");
  EXPECT_EQ(schema_violations("evaluation", evaluation), "");
  EXPECT_EQ(nlohmann::json::parse(evaluation)["data"]["poses"], 8);

  const auto store = storage::RunStore::open_read_only(folder / "runs.db");
  ASSERT_TRUE(store) << store.error().message;
  const auto stored = store->load(1);
  ASSERT_TRUE(stored) << stored.error().message;
  ASSERT_TRUE(write_samples(folder / "samples.csv", stored->grid));
  ASSERT_TRUE(write_static(folder / "static.csv", stored->soak));
  write_text(folder / "rig.toml", kRigToml);
  const auto from_files = run_plumbline({"calibrate", "--samples", folder / "samples.csv",
                                         "--static", folder / "static.csv", "--config",
                                         folder / "rig.toml", "--out", folder / "b"});
  ASSERT_EQ(from_files.exit_code, 0) << from_files.err;
  EXPECT_EQ(without_provenance(folder / "a/result.json"),
            without_provenance(folder / "b/result.json"));
  EXPECT_EQ(schema_violations("result", text_of(folder / "b/result.json")), "");
}

TEST(StoredRunCalibration, RefusesWhatIsNotThere) {
  const TempFolder folder;
  const StoredRun run(folder / "runs.db");
  const auto no_run = run_plumbline(
      {"calibrate", "--run", "7", "--db", folder / "runs.db", "--out", folder / "out"});
  EXPECT_EQ(no_run.exit_code, 2);
  EXPECT_EQ(no_run.error_lines(), 1) << no_run.err;
  const auto no_file = run_plumbline(
      {"calibrate", "--run", "1", "--db", folder / "none.db", "--out", folder / "out"});
  EXPECT_EQ(no_file.exit_code, 2);
  EXPECT_EQ(no_file.error_lines(), 1) << no_file.err;
  EXPECT_FALSE(fs::exists(folder / "none.db"));
  EXPECT_FALSE(fs::exists(folder / "out"));
}

}  // namespace
}  // namespace plumbline::app
