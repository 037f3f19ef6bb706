// The hash chain finds whatever was done to the database behind the program's back.
#include "storage/hash_chain.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "storage/schema.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::storage {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

PoseRecord pose_with_covariate(long long ordinal) {
  PoseRecord pose = example_pose(ordinal);
  pose.covariates = {{"rh_pct", pose.samples.front().t_s, 40}};
  return pose;
}

class HashChainTest : public StoreTest {
 protected:
  void SetUp() override {
    RunStore store = RunStore::open(file_).value();
    run_ = store.create_run(example_header()).value();
    const RunId other = store.create_run(example_header()).value();
    for (int i = 0; i < 5; ++i) {
      ASSERT_TRUE(store.commit_pose(run_, pose_with_covariate(i)));
      ASSERT_TRUE(store.commit_pose(other, pose_with_covariate(i)));
    }
  }
  ChainReport report(RunId run) {
    return RunStore::open_read_only(file_).value().check_chain(run).value();
  }
  /// As somebody with an SQLite shell would do it: no trigger stands in the way.
  void tamper(const std::string& sql) {
    const auto db = Database::open(file_, OpenMode::create).value();
    std::string triggers;
    ASSERT_TRUE(
        db->each("SELECT name FROM sqlite_schema WHERE type = 'trigger'",
                 [&](const Statement& row) { triggers += "DROP TRIGGER " + row.text(0) + ";"; }));
    const auto done = db->execute("PRAGMA foreign_keys=OFF;" + triggers + sql);
    ASSERT_TRUE(done) << done.error().message;
  }
  RunId run_ = 0;
};

TEST_F(HashChainTest, HasTheDocumentedBytes) {
  // Worked out with Python's hashlib and struct from the layout in hash_chain.h.
  const Hash first = first_link(1, example_header());
  EXPECT_EQ(to_hex(first), "d522f5025d3f28c2a1ac5aec6f99e47e31b3cc101aa910914acf2e8c37c647a7");
  EXPECT_EQ(to_hex(next_link(first, pose_with_covariate(0))),
            "d4bca38aeff598cc6791b3ad8af33f5d16c7b67aa31140324550c62d2e28a380");
}

TEST_F(HashChainTest, IsUnbrokenAsRecorded) {
  const ChainReport sound = report(run_);
  EXPECT_THAT(sound.faults, IsEmpty());
  EXPECT_EQ(sound.poses, 5);
  EXPECT_THAT(sound.head, SizeIs(64));
  EXPECT_NE(sound.head, report(run_ + 1).head);
}

TEST_F(HashChainTest, FindsEveryChange) {
  const std::vector<std::string> changes = {
      "UPDATE pose SET delta_deg = delta_deg + 1e-9",
      "UPDATE pose SET h_enc_deg = 20",
      "UPDATE pose SET kind = 'verification'",
      "UPDATE pose SET settle_capped = 1",
      "UPDATE pose SET approach = 1",
      "UPDATE pose SET samples = zeroblob(37 * sample_count)",
      "UPDATE pose SET ordinal = 99",
      "UPDATE pose SET first_t_s = first_t_s - 1",
      "UPDATE pose SET last_t_s = last_t_s + 1",
      "UPDATE covariate SET value = 41",
      "UPDATE covariate SET name = 'x'",
      "DELETE FROM covariate",
      "UPDATE link SET hash = zeroblob(32)",
  };
  for (std::size_t i = 0; i < changes.size(); ++i) {
    std::filesystem::remove(file_);
    SetUp();
    const bool is_pose = changes[i].find(" pose ") != std::string::npos;
    tamper(changes[i] + (is_pose ? " WHERE run = 1 AND ordinal = 2" : " WHERE pose = 5"));
    EXPECT_THAT(report(1).faults, Not(IsEmpty())) << changes[i];
    EXPECT_THAT(report(2).faults, IsEmpty()) << changes[i];
  }
}

TEST_F(HashChainTest, NamesThePoseThatWasChangedAndNoOther) {
  tamper("UPDATE pose SET settle_s = 9 WHERE run = 1 AND ordinal = 3");
  EXPECT_THAT(report(1).faults, ElementsAre(HasSubstr("pose 3 (grid): was changed")));
}

TEST_F(HashChainTest, FindsDeletionsInTheMiddleAndAtTheEnd) {
  tamper("DELETE FROM pose WHERE run = 1 AND ordinal = 2; DELETE FROM covariate WHERE pose = 5");
  EXPECT_THAT(report(1).faults, ElementsAre(HasSubstr("pose 3 (grid)"), HasSubstr("row 5")));
  tamper("DELETE FROM link WHERE pose = 5");
  EXPECT_THAT(report(1).faults, ElementsAre(HasSubstr("pose 3 (grid)")));
  tamper(
      "DELETE FROM pose WHERE run = 2 AND ordinal = 4; DELETE FROM link WHERE pose = 10;"
      "DELETE FROM covariate WHERE pose = 10");
  EXPECT_THAT(report(2).faults, ElementsAre(HasSubstr("head of the chain")));
}

TEST_F(HashChainTest, FindsInsertionsAndAChangedDescription) {
  tamper(
      "INSERT INTO pose SELECT 100, run, 50, kind, delta_deg, h_deg, delta_enc_deg, h_enc_deg,"
      " settle_s, settle_capped, first_t_s, last_t_s, sample_count, samples, approach"
      " FROM pose WHERE id = 1");
  EXPECT_THAT(report(1).faults, ElementsAre(HasSubstr("pose 50 (grid): was not recorded")));
  tamper("UPDATE run SET serial = 'B' WHERE id = 2");
  EXPECT_THAT(report(2).faults, ElementsAre(HasSubstr("pose 0 (grid): was changed, or the "
                                                      "description")));
}

TEST_F(HashChainTest, FindsAPoseThatWasTakenOutInSilence) {
  // No trigger refuses an insertion.
  tamper("INSERT INTO suspect VALUES (3, 'it was not to my liking')");
  EXPECT_THAT(report(1).faults, ElementsAre(HasSubstr("pose 1: was taken out of the run")));
  EXPECT_THAT(report(2).faults, IsEmpty());
}

TEST_F(HashChainTest, FindsRunsThatWereRemoved) {
  const auto removed = [this] { return RunStore::open_read_only(file_).value().removed_runs(); };
  EXPECT_THAT(removed().value(), IsEmpty());
  const std::string parts[] = {"covariate WHERE pose IN (SELECT id FROM pose WHERE run = ",
                               "link WHERE run = (", "pose WHERE run = (", "run WHERE id = ("};
  for (const int run : {1, 2}) {  // in the middle, and at the end
    for (const std::string& part : parts) tamper(fmt::format("DELETE FROM {}{})", part, run));
  }
  EXPECT_THAT(removed().value(), ElementsAre(1, 2));
}

TEST_F(HashChainTest, RunsOfAnOlderDatabaseGetTheirChain) {
  const std::string head = report(1).head;
  tamper(
      "DROP TABLE link; DROP TABLE identity; DROP TABLE suspect; ALTER TABLE run DROP COLUMN "
      "chain_head;"
      "ALTER TABLE pose DROP COLUMN approach; PRAGMA user_version = 1");
  ASSERT_TRUE(RunStore::open(file_));
  EXPECT_EQ(report(1).head, head);
  EXPECT_THAT(report(1).faults, IsEmpty());
}

}  // namespace
}  // namespace plumbline::storage
