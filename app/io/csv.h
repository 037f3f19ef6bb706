// Measurement files: samples.csv with poses, static.csv without, and records of other makers whose
// columns are named on the command line. The format itself is csv_table.h's.
//
// Strict: a row that cannot be used is refused with file, line and column or, on request, skipped
// and counted. Nothing is dropped silently.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

struct CsvOptions {
  bool skip_bad_rows = false;
  /// Columns of the three outputs.
  PerAxis<std::string> axis_columns = {"ux_V", "uy_V", "uz_V"};
  /// A scalar set: pose and angles may be absent. Without `pose` the set has samples but no poses,
  /// without angles `has_angles` is false.
  bool angle_free = false;
  /// Gives row i the time i / rate_hz when the file has no t_s; 0: t_s is required.
  double rate_hz = 0;
};

/// A record at one fixed pose.
struct StaticRecord {
  SampleTable samples;
  std::size_t skipped_rows = 0;
};

/// samples.csv: t_s, pose, delta_deg, h_deg, ux_V, uy_V, uz_V in any order, the optional encoder
/// and temperature columns, and further numeric columns as covariates. Time rises from row to row;
/// the rows of a pose stand together and have the same angles.
Result<MeasurementSet> read_samples(const std::filesystem::path& path,
                                    const CsvOptions& options = {});

/// static.csv: the same without pose and angles; where they stand in the file they have to be the
/// same in all rows.
Result<StaticRecord> read_static(const std::filesystem::path& path, const CsvOptions& options = {});

/// The named columns of any CSV file, in that order; other columns are not looked at and may hold
/// text.
Result<std::vector<std::vector<double>>> read_columns(const std::filesystem::path& path,
                                                      const std::vector<std::string>& names);

}  // namespace plumbline::app
