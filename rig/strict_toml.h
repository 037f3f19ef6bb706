// Strict reading of TOML: every key is asked for by name and type; what is left over is refused by
// name, with the nearest known key suggested. Used for run.toml, rig.toml and world.toml alike.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"
#include "rig/toml.h"

namespace plumbline::rig {

/// Closed interval of allowed values.
struct Range {
  double min = -1e300;
  double max = 1e300;
};

class StrictFile;

/// One table being read. Errors are collected: the first one is what finish() reports, with file,
/// line and column. Reading goes on with defaults, so that a reader is plain straight-line code.
///
///     auto file = StrictFile::read("run.toml");            // or StrictFile::parse(text, name)
///     StrictTable root = file->root();
///     StrictTable gravity = root.table("gravity");         // absent tables read as empty ones
///     description.gravity.local_mps2 = gravity.number("local_mps2", {.min = 9, .max = 10});
///     if (auto done = file->finish(); !done) return fail(done.error());
class StrictTable {
 public:
  /// True when the key (value or table) is present.
  bool has(std::string_view key) const;
  /// True when the table itself stands in the file.
  bool present() const { return node_ != nullptr; }
  /// "head.registers", for messages.
  const std::string& path() const { return path_; }

  /// Required values: an absent key is an error.
  double number(std::string_view key, Range range = {});
  std::int64_t integer(std::string_view key, Range range = {});
  std::string text(std::string_view key);

  /// Values with a default.
  double number_or(std::string_view key, double fallback, Range range = {});
  std::int64_t integer_or(std::string_view key, std::int64_t fallback, Range range = {});
  std::string text_or(std::string_view key, std::string fallback);
  bool flag_or(std::string_view key, bool fallback);
  /// One of `choices`; anything else is refused with the nearest choice suggested.
  std::string choice_or(std::string_view key, std::string fallback,
                        const std::vector<std::string>& choices);
  /// An array of numbers; `count` 0 takes any length.
  std::vector<double> numbers_or(std::string_view key, std::vector<double> fallback,
                                 std::size_t count = 0, Range range = {});
  std::vector<std::string> texts_or(std::string_view key, std::vector<std::string> fallback);

  /// A sub-table; absent reads as an empty one whose required keys are errors.
  StrictTable table(std::string_view key);
  /// [[key]]: an array of tables; absent is empty.
  std::vector<StrictTable> tables(std::string_view key);
  /// Accepts `key` as it is, whatever is in it: somebody else reads it.
  void leave(std::string_view key) { find(key); }
  /// Keys of this table in file order, for tables whose keys are free (mark each with a getter).
  std::vector<std::string> keys() const;

  /// Reports a contradiction found by the reader, at the place of `key`.
  void refuse(std::string_view key, const std::string& reason);

 private:
  friend class StrictFile;
  struct State;
  StrictTable(std::shared_ptr<State> state, const toml::table* node, std::string path);
  const toml::node* find(std::string_view key);
  void refuse_at(const toml::node* node, const std::string& message);

  std::shared_ptr<State> state_;
  const toml::table* node_ = nullptr;
  std::string path_;
};

/// A parsed file that remembers which keys were asked for.
class StrictFile {
 public:
  static Result<StrictFile> read(const std::filesystem::path& path);
  static Result<StrictFile> parse(std::string_view text, const std::string& name);

  StrictTable root();
  /// Success when every value was right and every key in the file was asked for.
  Result<void> finish() const;
  /// The text as it was read, for storing with a run.
  const std::string& source() const;

 private:
  explicit StrictFile(std::shared_ptr<StrictTable::State> state) : state_(std::move(state)) {}
  std::shared_ptr<StrictTable::State> state_;
};

/// The member of `known` nearest to `word` by edit distance, or empty when none is near.
std::string nearest(std::string_view word, const std::vector<std::string>& known);

}  // namespace plumbline::rig
