// Recorded sets: shape, repeatability, truth.
#include "rig/sim/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <sstream>

#include "tests/sim/sim_rig.h"

namespace plumbline::sim {
namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, removed at the end.
class Recording : public ::testing::Test {
 protected:
  Recording()
      : folder_(fs::temp_directory_path() /
                (std::string("plumbline_record_") +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name() + "_" +
                 std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~Recording() override { fs::remove_all(folder_); }

  static std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  fs::path folder_;
};

RecordOptions small() {
  RecordOptions options;
  options.grid = {{0, 330, 30}, {0, 80, 20}};
  options.soak_s = 2;
  options.samples_per_pose = 4;
  options.verification_poses = 6;
  return options;
}

const char* const kNoisy = "[noise]\nN = 1e-5\nB = 1e-5\n";

TEST_F(Recording, SameSeedSameBytesOtherSeedOtherBytes) {
  const World world = world_of(kNoisy);
  RecordOptions options = small();
  ASSERT_TRUE(record(world, options, folder_ / "a"));
  ASSERT_TRUE(record(world, options, folder_ / "b"));
  options.seed = 2;
  ASSERT_TRUE(record(world, options, folder_ / "c"));
  for (const char* name : {"samples.csv", "static.csv", "confirm.csv", "truth.json", "run.toml"}) {
    EXPECT_EQ(text_of(folder_ / "a" / name), text_of(folder_ / "b" / name)) << name;
  }
  for (const char* name : {"samples.csv", "static.csv", "confirm.csv"}) {
    EXPECT_NE(text_of(folder_ / "a" / name), text_of(folder_ / "c" / name)) << name;
  }
}

TEST_F(Recording, FilesAreWellFormed) {
  ASSERT_TRUE(record(world_of(kNoisy), small(), folder_));
  std::istringstream lines(text_of(folder_ / "samples.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V,temp_C,rh_pct,supply_V,motor_A");
  double last_s = -1;
  int rows = 0;
  while (std::getline(lines, line)) {
    double t_s = 0;
    int pose = -1;
    ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%d,", &t_s, &pose), 2) << line;
    EXPECT_GT(t_s, last_s);
    EXPECT_EQ(pose, rows / 4);
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 10);
    last_s = t_s;
    ++rows;
  }
  EXPECT_EQ(rows, 12 * 5 * 4);
  EXPECT_THAT(text_of(folder_ / "static.csv"), ::testing::StartsWith("t_s,ux_V,uy_V,uz_V,temp_C"));
  const auto truth = nlohmann::json::parse(text_of(folder_ / "truth.json"));
  for (const char* key : {"case", "K", "U0", "lsb", "effects", "oracle_pose_rms", "before_pose_rms",
                          "confirm_oracle", "confirm_before"}) {
    EXPECT_TRUE(truth.contains(key)) << key;
  }
  EXPECT_EQ(truth["K"][0][0], 0.03);
}

TEST_F(Recording, FolderThatCannotBeMadeIsAnOutputError) {
  std::ofstream(folder_ / "file") << "x";
  const auto done = record(world_of(""), small(), folder_ / "file" / "inside");
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::output);
}

TEST_F(Recording, PlanOfOthersIsFollowed) {
  std::ofstream(folder_ / "plan.csv") << "ordinal,kind,delta_deg,h_deg,samples,via\n"
                                         "0,soak,0,0,10,\n"
                                         "1,grid,30,10,3,28:10\n"
                                         "2,grid,20,0,2,40:0 18:0\n"
                                         "3,verification,11.5,3.5,4,\n";
  RecordOptions options;
  auto plan = read_plan(folder_ / "plan.csv");
  ASSERT_TRUE(plan) << plan.error().message;
  options.plan = *plan;
  EXPECT_EQ(plan->at(2).via_delta_deg, 18);
  const RecordedSet set = record_set(world_of(""), options);
  EXPECT_EQ(set.soak.size(), 10U);
  ASSERT_EQ(set.run.poses.size(), 2U);
  EXPECT_EQ(set.run.poses[1].first, 3U);
  EXPECT_EQ(set.run.poses[1].delta_deg, 20);
  ASSERT_EQ(set.verification.poses.size(), 1U);
  EXPECT_GT(set.verification.samples.t_s.front(), set.run.samples.t_s.back() + 30);
}

TEST_F(Recording, WrongPlansAreRefusedWithTheirLine) {
  const auto refusal = [&](const std::string& text) {
    std::ofstream(folder_ / "plan.csv") << text;
    const auto plan = read_plan(folder_ / "plan.csv");
    return plan ? std::string("accepted") : plan.error().message;
  };
  EXPECT_THAT(refusal("kind,delta_deg,h_deg\n"), ::testing::HasSubstr("samples is missing"));
  EXPECT_THAT(refusal("kind,delta_deg,h_deg,samples\ngrid,0,x,1\n"),
              ::testing::HasSubstr("plan.csv:2: h_deg \"x\" is not a number"));
  EXPECT_THAT(refusal("kind,delta_deg,h_deg,samples\ngrid,0,0\n"),
              ::testing::HasSubstr("3 columns where the header has 4"));
  EXPECT_THAT(refusal("kind,delta_deg,h_deg,samples\n"), ::testing::HasSubstr("no step"));
}

TEST(RecordedSets, OrdersVisitTheSamePositions) {
  const Grid grid{{0, 350, 10}, {0, 80, 10}};
  const auto positions = [&](RecordOrder order) {
    std::set<std::pair<int, int>> all;
    for (const Visit& v : grid_visits(grid, order, 1, 1)) {
      all.emplace(static_cast<int>(v.delta_deg) % 360, static_cast<int>(v.h_deg));
    }
    return all;
  };
  const auto raster = positions(RecordOrder::raster);
  EXPECT_EQ(raster.size(), 324U);
  EXPECT_EQ(positions(RecordOrder::snake), raster);
  EXPECT_EQ(positions(RecordOrder::spiral), raster);
  EXPECT_EQ(positions(RecordOrder::random), raster);
  const auto snake = grid_visits(grid, RecordOrder::snake, 1, 1);
  EXPECT_EQ(snake[36].delta_deg, 350);
  const auto spiral = grid_visits(grid, RecordOrder::spiral, 1, 1);
  EXPECT_EQ(spiral[36].delta_deg, 360);
  const auto random = grid_visits(grid, RecordOrder::random, 1, 1);
  EXPECT_NE(random[0].delta_deg * 100 + random[1].delta_deg,
            grid_visits(grid, RecordOrder::random, 1, 2)[0].delta_deg * 100 +
                grid_visits(grid, RecordOrder::random, 1, 2)[1].delta_deg);
}

TEST(RecordedSets, ResidualOfWhiteNoiseIsThatOfThePoseMeans) {
  // 1 mV/√Hz·… : N = 1e-5 V·√s gives 0.1 mV a sample, 0.05 mV a mean of 4, 16.3 mm/s² at 30 mV/g.
  RecordOptions options = small();
  options.grid = {};
  const RecordedSet set = record_set(world_of("[noise]\nN = 1e-5\n"), options);
  const double expected = 0.05e-3 / 0.03 * 9.80665 * std::sqrt(320.0 / 324.0);
  for (const double rms : set.truth.poses.before) {
    EXPECT_NEAR(rms / expected, 1, 5 / std::sqrt(2 * 320.0));
  }
}

TEST(RecordedSets, OracleIsTheSameSetWithoutTheEffect) {
  const World plain = world_of(kNoisy);
  World bent = plain;
  bent.effects = {{"sensor.quadratic", {0}, {{"k2", 0.05}}, {}, "bias"}};
  const RecordedSet with = record_set(bent, small());
  const RecordedSet without = record_set(plain, small());
  EXPECT_EQ(with.truth.poses.oracle, without.truth.poses.before);
  EXPECT_EQ(with.truth.verification.oracle, without.truth.verification.before);
  EXPECT_GT(with.truth.poses.before[0], 5 * with.truth.poses.oracle[0]);
  EXPECT_EQ(with.truth.poses.before[1], with.truth.poses.oracle[1]);
}

TEST(RecordedSets, SlippedIndexIsCuredByHoming) {
  World world = world_of("");
  world.effects = {{"rig.index_slip", {0, 1, 2}, {{"epsilon", 2}, {"pose", 2}}, {}, "bias"}};
  const RecordedSet set = record_set(world, small());
  world.effects.clear();
  const RecordedSet plain = record_set(world, small());
  EXPECT_NE(set.run.samples.u_V, plain.run.samples.u_V);
  EXPECT_EQ(set.verification.samples.u_V, plain.verification.samples.u_V);
}

}  // namespace
}  // namespace plumbline::sim
