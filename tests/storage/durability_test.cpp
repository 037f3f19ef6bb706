// What a killed process, a full disk and a failing disk leave behind.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <map>

#include "storage/database.h"
#include "storage/sample_blob.h"
#include "tests/storage/failing_vfs.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::storage {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

constexpr int kSamples = 40;

class DurabilityTest : public StoreTest {
 protected:
  /// Sound, and every pose that is there is there once and as it was committed.
  std::vector<long long> check_whole(RunId run) {
    const auto database = Database::open(file_, OpenMode::create).value();
    std::string verdict;
    EXPECT_TRUE(database->each("PRAGMA integrity_check",
                               [&](const Statement& row) { verdict += row.text(0); }));
    EXPECT_EQ(verdict, "ok");
    EXPECT_TRUE(database->each("PRAGMA foreign_key_check",
                               [&](const Statement&) { ADD_FAILURE() << "orphan row"; }));
    std::vector<long long> ordinals;
    EXPECT_TRUE(database->each(
        "SELECT ordinal, samples FROM pose WHERE run = ?1 ORDER BY ordinal",
        [&](const Statement& row) {
          ordinals.push_back(row.integer(0));
          const auto expected = pack_samples(example_pose(row.integer(0), kSamples).samples);
          EXPECT_TRUE(std::ranges::equal(row.bytes(1), expected)) << row.integer(0);
        },
        run));
    EXPECT_EQ(database
                  ->integer("SELECT count(*) FROM (SELECT ordinal FROM pose GROUP BY run, ordinal"
                            " HAVING count(*) > 1)")
                  .value(),
              0);
    return ordinals;
  }
};

PoseRecord full_pose(long long ordinal) {
  PoseRecord pose = example_pose(ordinal, kSamples);
  pose.covariates = {{"rh_pct", pose.samples.front().t_s, 40}};
  return pose;
}

/// Goes on after the last committed pose for ever and writes each acknowledged ordinal to `pipe`.
[[noreturn]] void commit_until_killed(const std::filesystem::path& file, RunId run, int pipe) {
  auto store = RunStore::open(file);
  if (!store) _exit(1);
  const auto done = store->committed_poses(run);
  if (!done) _exit(1);
  for (long long next = done->empty() ? 0 : done->back() + 1;; ++next) {
    if (!store->commit_pose(run, full_pose(next))) _exit(1);
    if (::write(pipe, &next, sizeof next) != sizeof next) _exit(1);
  }
}

TEST_F(DurabilityTest, AKilledProcessLosesNoAcknowledgedPose) {
  const RunId run = RunStore::open(file_).value().create_run(example_header()).value();
  std::vector<long long> acknowledged;
  for (int round = 0; round < 12; ++round) {
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::close(ends[0]);
      commit_until_killed(file_, run, ends[1]);
    }
    ::close(ends[1]);
    long long ordinal = 0;
    for (int i = 0; i <= round && ::read(ends[0], &ordinal, sizeof ordinal) == sizeof ordinal;
         ++i) {
      acknowledged.push_back(ordinal);
    }
    ::usleep(static_cast<useconds_t>(137 * round));  // into the middle of some later commit
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child failed by itself";
    while (::read(ends[0], &ordinal, sizeof ordinal) == sizeof ordinal) {
      acknowledged.push_back(ordinal);
    }
    ::close(ends[0]);

    const auto stored = check_whole(run);
    EXPECT_TRUE(std::ranges::includes(stored, acknowledged));
    for (std::size_t i = 0; i < stored.size(); ++i) {
      ASSERT_EQ(stored[i], static_cast<long long>(i)) << "no gap";
    }
  }
  EXPECT_GE(acknowledged.size(), 78u);  // 1 + 2 + … + 12
}

/// Files of this process cannot grow beyond `bytes` while it lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limited = before_;
    limited.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limited);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
};

TEST_F(DurabilityTest, AFileThatMayNotGrowStopsTheRunAndLosesNothing) {
  RunStore store = RunStore::open(file_).value();
  const RunId run = store.create_run(example_header()).value();
  long long next = 0;
  {
    const FileSizeLimit limit(200'000);
    for (;; ++next) {
      ASSERT_LT(next, 1000) << "the limit has no effect";
      const auto done = store.commit_pose(run, full_pose(next));
      if (done) continue;
      EXPECT_EQ(done.error().code, ErrorCode::storage);
      EXPECT_THAT(done.error().message, HasSubstr("disk I/O error (File too large)"));
      EXPECT_THAT(done.error().message,
                  HasSubstr(fmt::format("(while storing pose {} of run 1; all poses before it are "
                                        "safe)",
                                        next)));
      break;
    }
    EXPECT_GT(next, 3);
    EXPECT_EQ(store.committed_poses(run).value().size(), static_cast<std::size_t>(next));
  }
  // With room again the same connection goes on at the refused pose.
  for (long long end = next + 5; next < end; ++next) {
    ASSERT_TRUE(store.commit_pose(run, full_pose(next)));
  }
  EXPECT_EQ(check_whole(run).size(), static_cast<std::size_t>(next));
}

TEST_F(DurabilityTest, EveryFailingWriteOrSyncIsReportedAndLosesNothing) {
  FailingVfs vfs;
  for (const auto& [code, text] : {std::pair(SQLITE_FULL, "database or disk is full"),
                                   std::pair(SQLITE_IOERR_WRITE, "disk I/O error")}) {
    for (int fail_at = 1;; ++fail_at) {
      ASSERT_LT(fail_at, 2000) << "never got through";
      std::filesystem::remove(file_);
      std::filesystem::remove(file_.string() + "-wal");
      std::filesystem::remove(file_.string() + "-shm");
      RunId run = 0;
      long long acknowledged = 0;
      bool failed = false;
      {
        RunStore store = RunStore::open(file_).value();
        run = store.create_run(example_header()).value();
        vfs.fail_at(fail_at, code);
        while (acknowledged < 4 && !failed) {
          const auto done = store.commit_pose(run, full_pose(acknowledged));
          if (done) {
            ++acknowledged;
          } else {
            failed = true;
            EXPECT_EQ(done.error().code, ErrorCode::storage);
            // A sync has no way of saying "full".
            EXPECT_THAT(done.error().message, AnyOf(HasSubstr(text), HasSubstr("disk I/O error")));
          }
        }
        if (failed) {
          // The disk stays bad: the next attempt fails too, and nothing is lost.
          EXPECT_FALSE(store.commit_pose(run, full_pose(acknowledged)));
        }
        vfs.work_again();
      }
      const auto stored = check_whole(run);
      EXPECT_GE(stored.size(), static_cast<std::size_t>(acknowledged)) << fail_at;
      EXPECT_LE(stored.size(), static_cast<std::size_t>(acknowledged) + 1) << fail_at;
      if (!failed) break;
    }
  }
}

}  // namespace
}  // namespace plumbline::storage
