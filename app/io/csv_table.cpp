#include "app/io/csv_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <charconv>
#include <cmath>
#include <limits>

#include "app/io/files.h"
#include "rig/strict_toml.h"

namespace plumbline::app {

namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Cuts the next field off `line`; the comma behind it goes too.
std::string_view cut_field(std::string_view& line) {
  const std::size_t end = std::min(line.find(','), line.size());
  std::string_view field = trimmed(line.substr(0, end));
  line.remove_prefix(std::min(end + 1, line.size()));
  if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
    field = trimmed(field.substr(1, field.size() - 2));
  }
  return field;
}

std::size_t count_fields(std::string_view line) {
  return static_cast<std::size_t>(std::count(line.begin(), line.end(), ',')) + 1;
}

/// As much of a field as fits into a one-line message.
std::string shown(std::string_view field) {
  constexpr std::size_t kLongest = 40;
  std::string text(field.substr(0, kLongest));
  for (char& c : text) {
    if (c >= 0 && (c < ' ' || c == 0x7f)) c = '?';
  }
  return "'" + text + (field.size() > kLongest ? "…'" : "'");
}

/// The value, or the reason why there is none.
std::string parse_number(std::string_view field, double& value) {
  if (field.empty()) return "a number is missing";
  std::string_view digits = field;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  const char* end = digits.data() + digits.size();
  const auto [rest, error] = std::from_chars(digits.data(), end, value);
  if (error == std::errc::result_out_of_range && rest == end) {
    return shown(field) + " is beyond the range of a number";
  }
  if (error != std::errc{} || rest != end) return shown(field) + " is not a number";
  if (!std::isfinite(value)) return shown(field) + " is not finite";
  return "";
}

}  // namespace

Result<CsvTable> CsvTable::open(const std::filesystem::path& path) {
  auto text = read_text(path);
  if (!text) return fail(text.error());
  CsvTable table;
  table.path_ = path.string();
  table.text_ = *std::move(text);
  if (auto header = table.read_header(); !header) return fail(header.error());
  return table;
}

bool CsvTable::next_line(std::string_view& line) {
  while (position_ < text_.size()) {
    const std::size_t end = std::min(text_.find('\n', position_), text_.size());
    line = std::string_view(text_).substr(position_, end - position_);
    position_ = end + 1;
    ++line_;
    if (line.ends_with('\r')) line.remove_suffix(1);
    const std::string_view content = trimmed(line);
    if (!content.empty() && content.front() != '#') return true;
  }
  return false;
}

Result<void> CsvTable::read_header() {
  if (text_.starts_with("\xef\xbb\xbf")) position_ = 3;  // byte order mark
  std::string_view line;
  if (!next_line(line)) return fail(ErrorCode::input, path_ + ": the file is empty");
  header_line_ = line_;
  const std::size_t count = count_fields(line);
  for (std::size_t column = 0; column < count; ++column) {
    const std::string name(cut_field(line));
    if (name.empty()) {
      return fail(ErrorCode::input,
                  fmt::format("{}:{}:{}: this column has no name", path_, line_, column + 1));
    }
    if (find(name)) {
      return fail(ErrorCode::input, fmt::format("{}:{}:{} ({}): a column of this name stands "
                                                "there twice",
                                                path_, line_, column + 1, name));
    }
    names_.push_back(name);
  }
  return {};
}

std::optional<std::size_t> CsvTable::find(std::string_view name) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found == names_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names_.begin());
}

Result<std::size_t> CsvTable::require(std::string_view name, const std::string& required) const {
  if (const auto column = find(name)) return *column;
  std::string hint;
  if (names_.size() == 1 && names_[0].find_first_of(";\t") != std::string::npos) {
    hint = "; fields are separated by commas";
  } else if (const std::string near = rig::nearest(name, names_); !near.empty()) {
    hint = fmt::format("; is it the one called {}?", shown(near));
  }
  return fail(ErrorCode::input, fmt::format("{}:{}: the column {} is missing (required: {}){}",
                                            path_, header_line_, name, required, hint));
}

std::optional<RowFault> CsvTable::parse(std::string_view line, const std::vector<bool>& wanted,
                                        std::vector<double>& row) const {
  const std::size_t count = count_fields(line);
  if (count != names_.size()) {
    return RowFault{std::min(count, names_.size()) - 1,
                    fmt::format("the row has {} fields and the header {}", count, names_.size())};
  }
  for (std::size_t column = 0; column < count; ++column) {
    const std::string_view field = cut_field(line);
    if (!wanted[column]) continue;
    std::string reason = parse_number(field, row[column]);
    if (!reason.empty()) return RowFault{column, std::move(reason)};
  }
  return std::nullopt;
}

Result<std::size_t> CsvTable::read(const std::vector<bool>& wanted, bool skip_bad_rows,
                                   const Accept& accept) {
  assert(wanted.size() == names_.size());
  std::vector<double> row(names_.size(), std::numeric_limits<double>::quiet_NaN());
  std::size_t accepted = 0;
  std::size_t skipped = 0;
  std::string_view line;
  while (next_line(line)) {
    std::optional<RowFault> fault = parse(line, wanted, row);
    if (!fault) fault = accept(row);
    if (!fault) {
      ++accepted;
    } else if (skip_bad_rows) {
      ++skipped;
    } else {
      return fail(ErrorCode::input,
                  fmt::format("{}:{}:{} ({}): {}", path_, line_, fault->column + 1,
                              names_[fault->column], fault->reason));
    }
  }
  if (accepted == 0) {
    return fail(ErrorCode::input,
                skipped == 0 ? path_ + ": no row of data follows the header"
                             : fmt::format("{}: none of its {} rows can be used", path_, skipped));
  }
  return skipped;
}

std::size_t CsvTable::row_bound() const {
  return static_cast<std::size_t>(std::count(text_.begin(), text_.end(), '\n')) + 1;
}

}  // namespace plumbline::app
