#include "storage/schema.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/storage/store_fixture.h"

namespace plumbline::storage {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

class SchemaTest : public StoreTest {
 protected:
  std::unique_ptr<Database> database(OpenMode mode = OpenMode::create) {
    return std::move(Database::open(file_, mode).value());
  }
  std::vector<Migration> with_next(std::string script) {
    std::vector<Migration> steps(migrations().begin(), migrations().end());
    steps.push_back({steps.back().to + 1, std::move(script)});
    return steps;
  }
};

TEST_F(SchemaTest, ANewFileIsOursDurableAndChecked) {
  const auto db = database();
  ASSERT_TRUE(migrate(*db));
  EXPECT_EQ(db->integer("PRAGMA application_id").value(), 0x504C4D42);
  EXPECT_EQ(db->integer("PRAGMA user_version").value(), migrations().back().to);
  EXPECT_EQ(db->integer("PRAGMA foreign_keys").value(), 1);
  EXPECT_EQ(db->integer("PRAGMA synchronous").value(), 2);
  std::string mode;
  ASSERT_TRUE(db->each("PRAGMA journal_mode", [&](const Statement& row) { mode = row.text(0); }));
  EXPECT_EQ(mode, "wal");
  EXPECT_EQ(db->integer("SELECT count(*) FROM pragma_table_list WHERE type = 'table' AND strict = 0"
                        " AND name NOT LIKE 'sqlite_%'")
                .value(),
            0);
  EXPECT_TRUE(migrate(*db)) << "a second time changes nothing";
  EXPECT_TRUE(check_schema(*db));
}

TEST_F(SchemaTest, AnOlderDatabaseIsBroughtUpToDateWithItsData) {
  {
    RunStore store = RunStore::open(file_).value();
    const RunId run = store.create_run(example_header()).value();
    ASSERT_TRUE(store.commit_pose(run, example_pose(0)));
  }
  const auto steps = with_next("ALTER TABLE run ADD COLUMN operator TEXT NOT NULL DEFAULT '?'");
  const auto early = check_schema(*database(OpenMode::read_only), steps);
  ASSERT_FALSE(early);
  EXPECT_EQ(early.error().code, ErrorCode::input);
  EXPECT_THAT(early.error().message, HasSubstr("has schema 2 and this program reads 3"));

  const auto db = database();
  ASSERT_TRUE(migrate(*db, steps));
  EXPECT_EQ(db->integer("PRAGMA user_version").value(), 3);
  EXPECT_EQ(db->integer("SELECT count(*) FROM run WHERE operator = '?'").value(), 1);
  EXPECT_EQ(db->integer("SELECT count(*) FROM pose").value(), 1);
  EXPECT_TRUE(check_schema(*database(OpenMode::read_only), steps));
}

TEST_F(SchemaTest, AFailedMigrationChangesNothing) {
  ASSERT_TRUE(migrate(*database()));
  const auto db = database();
  const auto done = migrate(*db, with_next("CREATE TABLE extra (x); SELECT no_such_function()"));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::storage);
  EXPECT_THAT(done.error().message, EndsWith("(while migrating to schema 3)"));
  EXPECT_EQ(db->integer("PRAGMA user_version").value(), 2);
  EXPECT_EQ(db->integer("SELECT count(*) FROM sqlite_schema WHERE name = 'extra'").value(), 0);
  EXPECT_TRUE(RunStore::open(file_)) << "still usable";
}

TEST_F(SchemaTest, ADatabaseOfANewerProgramIsRefused) {
  ASSERT_TRUE(migrate(*database(), with_next("CREATE TABLE extra (x INTEGER) STRICT")));
  for (const auto& store : {RunStore::open(file_), RunStore::open_read_only(file_)}) {
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, ErrorCode::input);
    EXPECT_THAT(store.error().message,
                EndsWith("runs.db: was written by a newer plumbline (schema 3, this program knows "
                         "2); use a program at least that new"));
  }
}

}  // namespace
}  // namespace plumbline::storage
