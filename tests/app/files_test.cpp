#include "app/io/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "app/io/sha256.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;

std::size_t entries(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(Files, WritesReplacesAndFollowsALink) {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.txt";
  ASSERT_TRUE(write_file_atomically(path, "one"));
  ASSERT_TRUE(write_file_atomically(path, std::string("t\0wo", 4)));
  EXPECT_EQ(read_text(path).value(), std::string("t\0wo", 4));
  fs::create_symlink("a.txt", folder.path() / "link");
  ASSERT_TRUE(write_file_atomically(folder.path() / "link", "three"));
  EXPECT_TRUE(fs::is_symlink(folder.path() / "link"));
  EXPECT_EQ(read_text(path).value(), "three");
  EXPECT_EQ(entries(folder.path()), 2u);
}

TEST(Files, AFailedWriteKeepsTheOldFileAndLeavesNoTrace) {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.txt";
  ASSERT_TRUE(write_file_atomically(path, "old"));
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit small = before;
  small.rlim_cur = 1000;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const auto done = write_file_atomically(path, std::string(5000, 'x'));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::output);
  EXPECT_EQ(done.error().message, path.string() + ": cannot write: File too large");
  EXPECT_EQ(read_text(path).value(), "old");
  EXPECT_EQ(entries(folder.path()), 1u);
}

TEST(Files, AFolderIsNoFile) {
  const TempFolder folder;
  const auto done = write_file_atomically(folder.path(), "x");
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, folder.path().string() + ": cannot write: Is a directory");
}

TEST(Sha256, GivesThePublishedExamples) {  // FIPS 180-4 examples
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  const TempFolder folder;
  std::ofstream(folder.path() / "abc") << "abc";
  EXPECT_EQ(sha256_of_file(folder.path() / "abc").value(), sha256("abc"));
  const auto absent = sha256_of_file(folder.path() / "none");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::input);
}

}  // namespace
}  // namespace plumbline::app
