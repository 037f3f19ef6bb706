#include "storage/run_store.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "storage/database.h"
#include "storage/sample_blob.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::storage {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(SampleBlob, HasTheDocumentedBytes) {
  RawSample sample;
  sample.counter = 0x0102030405060708;
  sample.t_s = 1.0;  // 0x3FF0000000000000
  sample.code = {-1, 0x00010203, -2147483647 - 1};
  sample.temp_C = -2.0;  // 0xC000000000000000
  sample.status = 0xA5;
  const unsigned char expected[] = {8, 7, 6, 5,    4, 3, 2,    1,  // counter
                                    0, 0, 0, 0,    0, 0, 0xF0, 0x3F, 0xFF, 0xFF, 0xFF, 0xFF,  // x
                                    3, 2, 1, 0,                                               // y
                                    0, 0, 0, 0x80,                                            // z
                                    0, 0, 0, 0,    0, 0, 0,    0xC0, 0xA5};
  const auto bytes = pack_samples({&sample, 1});
  ASSERT_EQ(bytes.size(), kSampleBytes);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    EXPECT_EQ(std::to_integer<unsigned>(bytes[i]), expected[i]) << i;
  }
  const auto back = unpack_samples(bytes);
  ASSERT_EQ(back.size(), 1u);
  EXPECT_EQ(back[0].counter, sample.counter);
  EXPECT_EQ(back[0].t_s, sample.t_s);
  EXPECT_EQ(back[0].code, sample.code);
  EXPECT_EQ(back[0].temp_C, sample.temp_C);
  EXPECT_EQ(back[0].status, sample.status);
}

class RunStoreTest : public StoreTest {
 protected:
  RunStore open() { return std::move(RunStore::open(file_).value()); }
};

TEST_F(RunStoreTest, KeepsWhatIsKnownOfARun) {
  RunStore store = open();
  const RunId first = store.create_run(example_header()).value();
  const RunId second = store.create_run(example_header()).value();
  EXPECT_LT(first, second);
  ASSERT_TRUE(store.commit_pose(first, example_pose(0, 3)));
  ASSERT_TRUE(store.commit_pose(first, example_pose(1, 4)));
  ASSERT_TRUE(store.finish_run(first, RunState::finished, "2026-01-02T04:00:00Z"));

  const auto runs = RunStore::open_read_only(file_).value().runs().value();
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0].id, first);
  EXPECT_EQ(runs[0].header.serial, "A-0017");
  EXPECT_EQ(runs[0].header.program_version, "0.1.0");
  EXPECT_EQ(runs[0].header.config_toml, example_header().config_toml);
  EXPECT_EQ(runs[0].header.plan_csv, example_header().plan_csv);
  EXPECT_EQ(runs[0].header.started_utc, "2026-01-02T03:04:05Z");
  EXPECT_EQ(runs[0].header.rate_hz, 100);
  EXPECT_EQ(runs[0].header.adc.bits, 12);
  EXPECT_EQ(runs[0].header.adc.min_V, -5);
  EXPECT_EQ(runs[0].state, RunState::finished);
  EXPECT_EQ(runs[0].finished_utc, "2026-01-02T04:00:00Z");
  EXPECT_EQ(runs[0].poses, 2);
  EXPECT_EQ(runs[0].samples, 7);
  EXPECT_EQ(runs[1].state, RunState::running);
  EXPECT_EQ(runs[1].poses, 0);
  EXPECT_THAT(store.committed_poses(first).value(), ElementsAre(0, 1));
  EXPECT_THAT(store.committed_poses(second).value(), IsEmpty());
}

TEST_F(RunStoreTest, LoadTurnsCodesIntoVoltsAndVisitsIntoPoses) {
  RunStore store = open();
  const RunId run = store.create_run(example_header()).value();
  ASSERT_TRUE(store.commit_pose(run, example_pose(0, 5, PoseKind::soak)));
  PoseRecord later = example_pose(7, 2);  // visited before pose 3
  for (RawSample& sample : later.samples) sample.t_s -= 60;
  ASSERT_TRUE(store.commit_pose(run, later));
  ASSERT_TRUE(store.commit_pose(run, example_pose(3, 3)));
  ASSERT_TRUE(store.commit_pose(run, example_pose(9, 1, PoseKind::verification)));
  ASSERT_TRUE(store.add_event(run, {1.5, "2026-01-02T03:05:00Z", "state", "moving"}));

  const StoredRun loaded = store.load(run).value();
  EXPECT_EQ(loaded.soak.size(), 5u);
  EXPECT_TRUE(loaded.soak.delta_enc_deg.empty());
  ASSERT_EQ(loaded.grid.poses.size(), 2u);
  EXPECT_TRUE(loaded.grid.has_angles);
  EXPECT_EQ(loaded.grid.poses[0].number, 0);
  EXPECT_EQ(loaded.grid.poses[0].delta_deg, 70);
  EXPECT_EQ(loaded.grid.poses[0].count, 2u);
  EXPECT_EQ(loaded.grid.poses[1].number, 1);
  EXPECT_EQ(loaded.grid.poses[1].delta_deg, 30);
  EXPECT_EQ(loaded.grid.poses[1].first, 2u);
  EXPECT_THAT(loaded.grid.samples.delta_enc_deg,
              ElementsAre(70.001, 70.001, 30.001, 30.001, 30.001));
  EXPECT_THAT(loaded.grid.samples.temp_C, ElementsAre(20.5, 20.5, 20.5, 20.5, 20.5));
  // 12 bits over 5 V: code 0 is mid-span −2.5 V, one step 5/4096 V.
  EXPECT_EQ(loaded.grid.samples.u_V[0][0], -2.5);
  EXPECT_EQ(loaded.grid.samples.u_V[0][1], -2.5 + 5.0 / 4096);
  EXPECT_EQ(loaded.grid.samples.u_V[1][1], -2.5 - 5.0 / 4096);
  EXPECT_EQ(loaded.verification.poses.size(), 1u);
  ASSERT_EQ(loaded.events.size(), 1u);
  EXPECT_EQ(loaded.events[0].text, "moving");
  EXPECT_THAT(loaded.left_out, IsEmpty());
}

TEST_F(RunStoreTest, CovariatesAreHeldForAMinuteAndLeftOutWhereUnknown) {
  RunStore store = open();
  const RunId run = store.create_run(example_header()).value();
  PoseRecord first = example_pose(0, 2);  // t = 0, 0.01
  first.covariates = {{"rh_pct", 0.005, 40}, {"old_V", 0.0, 1}};
  PoseRecord second = example_pose(7, 2);  // t = 70, 70.01
  second.covariates = {{"rh_pct", 70.0, 41}, {"rh_pct", 70.01, 42}};
  ASSERT_TRUE(store.commit_pose(run, first));
  ASSERT_TRUE(store.commit_pose(run, second));

  const StoredRun loaded = store.load(run).value();
  ASSERT_EQ(loaded.grid.samples.covariates.size(), 1u);
  EXPECT_EQ(loaded.grid.samples.covariates[0].name, "rh_pct");
  EXPECT_THAT(loaded.grid.samples.covariates[0].value, ElementsAre(40, 40, 41, 42));
  EXPECT_THAT(loaded.left_out, ElementsAre("old_V (grid)"));
}

TEST_F(RunStoreTest, ATemperatureThatWasNotMeasuredGivesNoColumn) {
  RunStore store = open();
  const RunId run = store.create_run(example_header()).value();
  PoseRecord pose = example_pose(0, 2);
  for (RawSample& sample : pose.samples) sample.temp_C = std::nan("");
  ASSERT_TRUE(store.commit_pose(run, pose));
  const StoredRun loaded = store.load(run).value();
  EXPECT_TRUE(loaded.grid.samples.temp_C.empty());
  EXPECT_THAT(loaded.left_out, IsEmpty());
}

TEST_F(RunStoreTest, APoseIsStoredOnceAndOnlyForwardInTime) {
  RunStore store = open();
  const RunId run = store.create_run(example_header()).value();
  ASSERT_TRUE(store.commit_pose(run, example_pose(1)));

  const auto again = store.commit_pose(run, example_pose(1));
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::storage);
  EXPECT_THAT(again.error().message, HasSubstr("run 1, pose 1: is already stored"));

  const auto backwards = store.commit_pose(run, example_pose(0));
  ASSERT_FALSE(backwards);
  EXPECT_EQ(backwards.error().code, ErrorCode::rig);
  EXPECT_THAT(backwards.error().message,
              EndsWith("run 1, pose 0: sample 0 at 0 s is not later than the one before it at "
                       "10.02 s; has the node restarted?"));

  const auto empty = store.commit_pose(run, example_pose(2, 0));
  ASSERT_FALSE(empty);
  EXPECT_THAT(empty.error().message, EndsWith("has no sample"));
  const auto orphan = store.commit_pose(99, example_pose(2));
  ASSERT_FALSE(orphan);
  EXPECT_THAT(orphan.error().message, HasSubstr("FOREIGN KEY constraint failed (while storing"));
  PoseRecord undefined = example_pose(2);
  undefined.covariates = {{"rh_pct", 0, std::nan("")}};
  EXPECT_FALSE(store.commit_pose(run, undefined));

  EXPECT_THAT(store.committed_poses(run).value(), ElementsAre(1));
  ASSERT_TRUE(store.commit_pose(run, example_pose(2)));
}

TEST_F(RunStoreTest, UnknownRunsAreNamed) {
  RunStore store = open();
  const auto loaded = store.load(5);
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::input);
  EXPECT_THAT(loaded.error().message, HasSubstr("there is no run 5"));
  EXPECT_FALSE(store.finish_run(5, RunState::finished, ""));
  EXPECT_FALSE(store.add_event(5, {}));
}

TEST_F(RunStoreTest, AReaderSeesCommittedPosesWhileTheWriterGoesOn) {
  RunStore writer = open();
  const RunId run = writer.create_run(example_header()).value();
  ASSERT_TRUE(writer.commit_pose(run, example_pose(0)));
  const RunStore reader = RunStore::open_read_only(file_).value();
  EXPECT_EQ(reader.load(run).value().grid.poses.size(), 1u);
  ASSERT_TRUE(writer.commit_pose(run, example_pose(1)));
  EXPECT_EQ(reader.load(run).value().grid.poses.size(), 2u);
}

TEST_F(RunStoreTest, MeasuredRowsCannotBeChanged) {
  {
    RunStore store = open();
    const RunId run = store.create_run(example_header()).value();
    PoseRecord pose = example_pose(0);
    pose.covariates = {{"rh_pct", 0, 40}};
    ASSERT_TRUE(store.commit_pose(run, pose));
    ASSERT_TRUE(store.add_event(run, {}));
  }
  const auto database = Database::open(file_, OpenMode::create).value();
  for (const char* sql :
       {"UPDATE pose SET delta_deg = 1", "DELETE FROM pose", "UPDATE covariate SET value = 1",
        "DELETE FROM covariate", "UPDATE event SET text = 'x'", "DELETE FROM event",
        "UPDATE run SET serial = 'B'", "DELETE FROM run",
        "INSERT OR REPLACE INTO pose SELECT * FROM pose",
        "INSERT INTO covariate VALUES (99, 0, 'x', 0, 0)"}) {
    EXPECT_FALSE(database->execute(sql)) << sql;
  }
  const auto changed = database->execute("UPDATE pose SET h_deg = 1");
  ASSERT_FALSE(changed);
  EXPECT_THAT(changed.error().message, EndsWith("measured data are never changed"));
}

TEST_F(RunStoreTest, ASuspectPoseStaysStoredButOutOfTheRun) {
  RunStore store = open();
  const RunId run = store.create_run(example_header()).value();
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(store.commit_pose(run, example_pose(i)));
  ASSERT_TRUE(store.add_event(run, {.t_s = 30,
                                    .utc = "2026-01-01T00:00:00Z",
                                    .kind = "suspect",
                                    .text = "pose 1 is taken out: the head had slipped"}));
  ASSERT_TRUE(store.suspect_pose(run, 1, "the head had slipped"));
  EXPECT_THAT(store.committed_poses(run).value(), ElementsAre(0, 2));
  EXPECT_EQ(store.runs().value().front().poses, 2);
  EXPECT_EQ(store.load(run).value().grid.poses.size(), 2u);
  EXPECT_THAT(store.check_chain(run).value().faults, IsEmpty());
  EXPECT_FALSE(store.suspect_pose(run, 1, "twice"));
  const auto database = Database::open(file_, OpenMode::create).value();
  EXPECT_EQ(database->integer("SELECT count(*) FROM pose").value(), 3);
}

TEST_F(RunStoreTest, TheRigOfARunIsStatedOnce) {
  RunStore store = open();
  const RunId run = store.create_run(example_header()).value();
  EXPECT_FALSE(store.identity(run).value());
  ASSERT_TRUE(store.set_identity(run, {"drive 1", "node 2"}));
  EXPECT_EQ(store.identity(run).value()->drive, "drive 1");
  EXPECT_EQ(store.identity(run).value()->node, "node 2");
  EXPECT_FALSE(store.set_identity(run, {"drive 3", "node 2"}));
}

TEST_F(RunStoreTest, ForReadingTheFileMustBeThereAndOurs) {
  const auto refusal = [&] {
    const auto store = RunStore::open_read_only(file_);
    if (store) return std::string("opened");
    EXPECT_EQ(store.error().code, ErrorCode::input);
    return store.error().message.substr(folder_.string().size() + 1);
  };
  EXPECT_EQ(refusal(), "runs.db: there is no such database file");
  std::ofstream(file_) << "";
  EXPECT_EQ(refusal(), "runs.db: is empty, no run has been recorded in it");
  std::ofstream(file_) << "t_s,pose\n" << std::string(2000, 'x');
  EXPECT_EQ(refusal(), "runs.db: is not an SQLite database");
  fs::remove(file_);
  fs::create_directory(file_);
  EXPECT_EQ(refusal(), "runs.db: is a folder, not a database file");
}

TEST_F(RunStoreTest, AForeignDatabaseIsRefusedAndLeftAsItIs) {
  {
    const auto database = Database::open(file_, OpenMode::create).value();
    ASSERT_TRUE(database->execute("CREATE TABLE t (x); INSERT INTO t VALUES (1)"));
  }
  std::ifstream stream(file_, std::ios::binary);
  const std::string before{std::istreambuf_iterator<char>(stream), {}};
  for (const auto& store : {RunStore::open(file_), RunStore::open_read_only(file_)}) {
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, ErrorCode::input);
    EXPECT_THAT(store.error().message, EndsWith("is an SQLite database, but not one of plumbline"));
  }
  std::ifstream after(file_, std::ios::binary);
  EXPECT_EQ(before, (std::string{std::istreambuf_iterator<char>(after), {}}));
}

TEST_F(RunStoreTest, ADamagedDatabaseIsRefusedWhenRead) {
  RunId run = 0;
  {
    RunStore store = open();
    run = store.create_run(example_header()).value();
    for (int i = 0; i < 20; ++i) ASSERT_TRUE(store.commit_pose(run, example_pose(i, 40)));
  }
  fs::resize_file(file_, fs::file_size(file_) / 2);
  const auto store = RunStore::open_read_only(file_);
  const auto loaded = store ? store->load(run) : Result<StoredRun>(fail(store.error()));
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::input);
  EXPECT_THAT(loaded.error().message, HasSubstr("runs.db: database disk image is malformed"));
}

TEST_F(RunStoreTest, AMissingFolderIsNamedWhenCreating) {
  const auto store = RunStore::open(folder_ / "no" / "runs.db");
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::input);
  EXPECT_THAT(store.error().message, EndsWith("the folder does not exist; create it first"));
}

TEST_F(RunStoreTest, AnyFileNameWillDo) {
  file_ = folder_ / "50% ?of #2.db";
  {
    RunStore store = open();
    ASSERT_TRUE(store.create_run(example_header()));
  }
  EXPECT_TRUE(fs::exists(file_));
  EXPECT_EQ(RunStore::open_read_only(file_).value().runs().value().size(), 1u);
}

}  // namespace
}  // namespace plumbline::storage
