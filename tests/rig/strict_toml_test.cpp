#include "rig/strict_toml.h"

#include <gtest/gtest.h>

namespace plumbline::rig {
namespace {

std::string message_of(std::string_view text, void (*read)(StrictTable&)) {
  auto file = StrictFile::parse(text, "f.toml");
  if (!file) return file.error().message;
  StrictTable root = file->root();
  read(root);
  const auto done = file->finish();
  return done ? "" : done.error().message;
}

TEST(StrictToml, ReadsTypedValuesAndSubTables) {
  auto file = StrictFile::parse(
      "a = 1\nb = 2.5\n[t]\nname = \"n\"\nlist = [1, 2.5]\n[[e]]\nid = 7\n", "f.toml");
  ASSERT_TRUE(file);
  StrictTable root = file->root();
  EXPECT_EQ(root.integer("a"), 1);
  EXPECT_DOUBLE_EQ(root.number("b"), 2.5);
  StrictTable t = root.table("t");
  EXPECT_EQ(t.text("name"), "n");
  EXPECT_EQ(t.numbers_or("list", {}), (std::vector<double>{1, 2.5}));
  auto e = root.tables("e");
  ASSERT_EQ(e.size(), 1u);
  EXPECT_EQ(e[0].integer("id"), 7);
  EXPECT_TRUE(file->finish());
}

TEST(StrictToml, UnknownKeyIsNamedWithTheNearestKnownOne) {
  EXPECT_EQ(message_of("[gravity]\nlocl_mps2 = 9.81\n",
                       [](StrictTable& root) { root.table("gravity").number("local_mps2"); }),
            "f.toml:2:1: unknown key gravity.locl_mps2; did you mean local_mps2?");
}

TEST(StrictToml, UnknownTableIsNamed) {
  EXPECT_EQ(message_of("[gravty]\nlocal_mps2 = 9.81\n",
                       [](StrictTable& root) { root.table("gravity").number_or("local_mps2", 9); }),
            "f.toml:1:2: unknown key gravty; did you mean gravity?");
}

TEST(StrictToml, MissingWrongTypeAndRangeAreRefused) {
  EXPECT_EQ(
      message_of("[gravity]\n", [](StrictTable& r) { r.table("gravity").number("local_mps2"); }),
      "f.toml:1:1: [gravity] lacks the key local_mps2");
  EXPECT_EQ(message_of("bits = \"x\"\n", [](StrictTable& r) { r.integer("bits"); }),
            "f.toml:1:8: bits must be a whole number");
  EXPECT_EQ(
      message_of("bits = 99\n", [](StrictTable& r) { r.integer("bits", {.min = 8, .max = 24}); }),
      "f.toml:1:8: bits = 99 is out of range (8 … 24)");
  EXPECT_EQ(message_of("x = nan\n", [](StrictTable& r) { r.number("x", {.min = 0, .max = 1}); }),
            "f.toml:1:5: x = nan is out of range (0 … 1)");
}

TEST(StrictToml, SyntaxErrorHasAPlace) {
  EXPECT_TRUE(message_of("a = \n", [](StrictTable&) {}).starts_with("f.toml:1:"));
}

TEST(StrictToml, AControlCharacterForAKeyIsRefusedNotAsserted) {
  EXPECT_TRUE(message_of("[\x1c]\n", [](StrictTable&) {}).starts_with("f.toml:1:2: "));
}

TEST(StrictToml, LettersOutsideAStringAreRefused) {
  // Letters below U+049A, where the library's table of whitespace has a hole.
  const auto nothing = [](StrictTable&) {};
  EXPECT_TRUE(message_of("rate_hz = 2.е-5\n", nothing).starts_with("f.toml:1:"));
  EXPECT_TRUE(message_of("частота = 50\n", nothing).starts_with("f.toml:1:"));
}

TEST(StrictToml, NearestSuggestsNothingFar) {
  EXPECT_EQ(nearest("order", {"ordr", "speed"}), "ordr");
  EXPECT_EQ(nearest("zzzzzz", {"order", "speed"}), "");
}

}  // namespace
}  // namespace plumbline::rig
