#include "app/io/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iterator>

#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  return names;
}

TEST(OutputFolder, PublishesEverythingTogether) {
  const TempFolder temp;
  const fs::path out = temp / "a/b/c/";
  auto folder = OutputFolder::prepare(out);
  ASSERT_TRUE(folder) << folder.error().message;
  ASSERT_TRUE(folder->write("one.json", "1"));
  write_text(folder->staged("two.html"), "2");
  EXPECT_FALSE(fs::exists(out / "one.json"));
  ASSERT_TRUE(folder->publish());
  EXPECT_THAT(names_in(out), testing::UnorderedElementsAre("one.json", "two.html"));
  EXPECT_EQ(text_of(out / "one.json"), "1");
}

TEST(OutputFolder, LeavesNothingWithoutPublish) {
  const TempFolder temp;
  {
    auto folder = OutputFolder::prepare(temp / "a/b");
    ASSERT_TRUE(folder);
    ASSERT_TRUE(folder->write("one.json", "1"));
  }
  EXPECT_THAT(names_in(temp.path()), testing::IsEmpty());
}

TEST(OutputFolder, KeepsWhatWasThere) {
  const TempFolder temp;
  write_text(temp / "old.json", "old");
  write_text(temp / "other.txt", "other");
  {
    auto folder = OutputFolder::prepare(temp.path());
    ASSERT_TRUE(folder);
    ASSERT_TRUE(folder->write("old.json", "new"));
  }
  EXPECT_EQ(text_of(temp / "old.json"), "old");
  auto folder = OutputFolder::prepare(temp.path());
  ASSERT_TRUE(folder);
  ASSERT_TRUE(folder->write("old.json", "new"));
  ASSERT_TRUE(folder->publish());
  EXPECT_EQ(text_of(temp / "old.json"), "new");
  EXPECT_EQ(text_of(temp / "other.txt"), "other");
  EXPECT_THAT(names_in(temp.path()), testing::UnorderedElementsAre("old.json", "other.txt"));
}

TEST(OutputFolder, RefusesAFileInPlaceOfAFolder) {
  const TempFolder temp;
  write_text(temp / "file", "x");
  for (const char* place : {"file", "file/sub"}) {
    const auto folder = OutputFolder::prepare(temp / place);
    ASSERT_FALSE(folder);
    EXPECT_EQ(folder.error().code, ErrorCode::output);
    EXPECT_EQ(folder.error().message, (temp / place).string() + ": cannot write: Not a directory");
  }
}

TEST(OutputFolder, RefusesToReplaceAFolderByAFile) {
  const TempFolder temp;
  fs::create_directory(temp / "result.json");
  auto folder = OutputFolder::prepare(temp.path());
  ASSERT_TRUE(folder);
  ASSERT_TRUE(folder->write("another.json", "1"));
  ASSERT_TRUE(folder->write("result.json", "1"));
  const auto published = folder->publish();
  ASSERT_FALSE(published);
  EXPECT_EQ(published.error().message,
            (temp / "result.json").string() + ": cannot write: Is a directory");
  EXPECT_FALSE(fs::exists(temp / "another.json"));
}

}  // namespace
}  // namespace plumbline::app
