// A CSV file of numbers: one header line, `,` between fields, `.` as decimal point, LF or CRLF,
// `#` lines and blank lines passed over, plain or gzipped. Knows nothing of what the columns mean.
//
// Names and numbers may stand in double quotes. Every refusal is ErrorCode::input and says where:
// "samples.csv:17:4 (ux_V): 'abc' is not a number", that is file, line and field counted from 1.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

/// Why a row cannot be used.
struct RowFault {
  std::size_t column = 0;
  std::string reason;
};

/// A file being read from front to back. The text lives in the object.
class CsvTable {
 public:
  /// Reads the file and its header line.
  static Result<CsvTable> open(const std::filesystem::path& path);

  const std::vector<std::string>& names() const { return names_; }
  std::optional<std::size_t> find(std::string_view name) const;
  /// The column of that name; a missing one is refused with `required` as the list of what has to
  /// be there.
  Result<std::size_t> require(std::string_view name, const std::string& required) const;

  /// Parses the columns marked in `wanted` (one entry per column of the file) and hands each row,
  /// with all columns in file order, to `accept`, which returns the fault it finds. Numbers have to
  /// be finite. With `skip_bad_rows` faulty rows are passed over; their number is the result. A
  /// file without any usable row is refused.
  using Accept = std::function<std::optional<RowFault>(std::span<const double> row)>;
  Result<std::size_t> read(const std::vector<bool>& wanted, bool skip_bad_rows,
                           const Accept& accept);
  /// Upper bound of the number of rows, for reserving memory.
  std::size_t row_bound() const;

 private:
  CsvTable() = default;
  bool next_line(std::string_view& line);
  std::optional<RowFault> parse(std::string_view line, const std::vector<bool>& wanted,
                                std::vector<double>& row) const;
  Result<void> read_header();

  std::string path_;
  std::string text_;
  std::size_t position_ = 0;
  std::size_t line_ = 0;  ///< of the line read last, from 1
  std::size_t header_line_ = 0;
  std::vector<std::string> names_;
};

}  // namespace plumbline::app
