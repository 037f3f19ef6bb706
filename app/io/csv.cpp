#include "app/io/csv.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>
#include <unordered_set>

#include "app/io/csv_table.h"

namespace plumbline::app {

namespace {

/// What `pose`, `delta_deg` and `h_deg` have in common: they are constant within a pose.
enum PlaceColumn : std::size_t { kPose, kDelta, kTilt, kPlaceColumns };
constexpr std::array<const char*, kPlaceColumns> kPlaceName = {"pose", "delta_deg", "h_deg"};

/// Beyond this a double no longer holds every whole number.
constexpr double kLargestPose = 9e15;

/// Which column of the file means what.
struct Layout {
  std::optional<std::size_t> t_s;
  std::array<std::optional<std::size_t>, kPlaceColumns> place;
  PerAxis<std::size_t> axis{};
  std::optional<std::size_t> temp_C;
  std::optional<std::size_t> delta_enc_deg;
  std::optional<std::size_t> h_enc_deg;
  std::vector<std::size_t> covariates;
};

Result<Layout> find_layout(const CsvTable& file, const CsvOptions& options, bool place_required) {
  std::vector<std::string> required;
  if (options.rate_hz == 0) required.emplace_back("t_s");
  if (place_required) required.insert(required.end(), kPlaceName.begin(), kPlaceName.end());
  required.insert(required.end(), options.axis_columns.begin(), options.axis_columns.end());
  const std::string list = fmt::format("{}", fmt::join(required, ", "));
  for (const std::string& name : required) {
    if (auto column = file.require(name, list); !column) return fail(column.error());
  }

  Layout layout;
  layout.t_s = file.find("t_s");
  for (std::size_t i = 0; i < kPlaceColumns; ++i) layout.place[i] = file.find(kPlaceName[i]);
  for (std::size_t i = 0; i < kAxisCount; ++i) layout.axis[i] = *file.find(options.axis_columns[i]);
  layout.temp_C = file.find("temp_C");
  layout.delta_enc_deg = file.find("delta_enc_deg");
  layout.h_enc_deg = file.find("h_enc_deg");

  std::vector<bool> known(file.names().size(), false);
  const auto mark = [&](const std::optional<std::size_t>& column) {
    if (column) known[*column] = true;
  };
  mark(layout.t_s);
  for (const auto& column : layout.place) mark(column);
  for (const std::size_t column : layout.axis) known[column] = true;
  mark(layout.temp_C);
  mark(layout.delta_enc_deg);
  mark(layout.h_enc_deg);
  for (std::size_t column = 0; column < known.size(); ++column) {
    if (!known[column]) layout.covariates.push_back(column);
  }
  return layout;
}

/// Fills a SampleTable row by row.
class SampleReader {
 public:
  SampleReader(const CsvTable& file, const Layout& layout, double rate_hz, SampleTable& table)
      : layout_(layout), rate_hz_(rate_hz), table_(table) {
    const std::size_t rows = file.row_bound();
    table_.t_s.reserve(rows);
    for (auto& axis : table_.u_V) axis.reserve(rows);
    for (const std::size_t column : layout.covariates) {
      table_.covariates.push_back({file.names()[column], {}});
      table_.covariates.back().value.reserve(rows);
    }
  }

  /// The row's time, also for rows that are refused later: a skipped row leaves a gap.
  double next_time(std::span<const double> row) {
    return layout_.t_s ? row[*layout_.t_s] : static_cast<double>(row_++) / rate_hz_;
  }

  std::optional<RowFault> check_time(double t_s) const {
    if (table_.t_s.empty() || t_s > table_.t_s.back()) return std::nullopt;
    return RowFault{layout_.t_s.value_or(0),
                    fmt::format("time {} s does not come after {} s", t_s, table_.t_s.back())};
  }

  void append(double t_s, std::span<const double> row) {
    table_.t_s.push_back(t_s);
    for (std::size_t i = 0; i < kAxisCount; ++i) table_.u_V[i].push_back(row[layout_.axis[i]]);
    if (layout_.temp_C) table_.temp_C.push_back(row[*layout_.temp_C]);
    if (layout_.delta_enc_deg) table_.delta_enc_deg.push_back(row[*layout_.delta_enc_deg]);
    if (layout_.h_enc_deg) table_.h_enc_deg.push_back(row[*layout_.h_enc_deg]);
    for (std::size_t i = 0; i < layout_.covariates.size(); ++i) {
      table_.covariates[i].value.push_back(row[layout_.covariates[i]]);
    }
  }

 private:
  const Layout& layout_;
  double rate_hz_;
  SampleTable& table_;
  std::size_t row_ = 0;
};

/// Cuts the rows into poses.
class PoseReader {
 public:
  PoseReader(const Layout& layout, MeasurementSet& set) : layout_(layout), set_(set) {}

  /// Call before the row's sample is appended. Changes the set only when the row is good.
  std::optional<RowFault> add(std::span<const double> row) {
    if (!layout_.place[kPose]) return std::nullopt;
    const std::size_t column = *layout_.place[kPose];
    const double number = row[column];
    if (number != std::round(number) || std::abs(number) > kLargestPose) {
      return RowFault{column, fmt::format("pose {} is not a whole number", number)};
    }
    const auto pose = static_cast<long long>(number);
    const double delta_deg = place(row, kDelta);
    const double h_deg = place(row, kTilt);
    if (set_.poses.empty() || set_.poses.back().number != pose) {
      if (!seen_.insert(pose).second) {
        return RowFault{column, fmt::format("pose {} comes back after another pose; a position "
                                            "visited twice needs two numbers",
                                            pose)};
      }
      set_.poses.push_back({pose, delta_deg, h_deg, set_.samples.size(), 1});
      return std::nullopt;
    }
    Pose& current = set_.poses.back();
    if (current.delta_deg != delta_deg) return changes(kDelta, current.delta_deg, delta_deg, pose);
    if (current.h_deg != h_deg) return changes(kTilt, current.h_deg, h_deg, pose);
    ++current.count;
    return std::nullopt;
  }

 private:
  double place(std::span<const double> row, PlaceColumn which) const {
    return layout_.place[which] ? row[*layout_.place[which]] : 0.0;
  }
  std::optional<RowFault> changes(PlaceColumn which, double from, double to, long long pose) const {
    return RowFault{*layout_.place[which], fmt::format("the angle changes from {} to {} within "
                                                       "pose {}",
                                                       from, to, pose)};
  }

  const Layout& layout_;
  MeasurementSet& set_;
  std::unordered_set<long long> seen_;
};

}  // namespace

Result<MeasurementSet> read_samples(const std::filesystem::path& path, const CsvOptions& options) {
  auto file = CsvTable::open(path);
  if (!file) return fail(file.error());
  const auto layout = find_layout(*file, options, !options.angle_free);
  if (!layout) return fail(layout.error());

  MeasurementSet set;
  set.has_angles = layout->place[kDelta] && layout->place[kTilt];
  SampleReader samples(*file, *layout, options.rate_hz, set.samples);
  PoseReader poses(*layout, set);
  const auto skipped = file->read(std::vector<bool>(file->names().size(), true),
                                  options.skip_bad_rows, [&](std::span<const double> row) {
                                    const double t_s = samples.next_time(row);
                                    std::optional<RowFault> fault = samples.check_time(t_s);
                                    if (!fault) fault = poses.add(row);
                                    if (!fault) samples.append(t_s, row);
                                    return fault;
                                  });
  if (!skipped) return fail(skipped.error());
  set.skipped_rows = *skipped;
  return set;
}

Result<StaticRecord> read_static(const std::filesystem::path& path, const CsvOptions& options) {
  auto file = CsvTable::open(path);
  if (!file) return fail(file.error());
  const auto layout = find_layout(*file, options, false);
  if (!layout) return fail(layout.error());

  StaticRecord record;
  SampleReader samples(*file, *layout, options.rate_hz, record.samples);
  std::array<std::optional<double>, kPlaceColumns> place;
  const auto skipped = file->read(
      std::vector<bool>(file->names().size(), true), options.skip_bad_rows,
      [&](std::span<const double> row) {
        const double t_s = samples.next_time(row);
        std::optional<RowFault> fault = samples.check_time(t_s);
        for (std::size_t i = 0; i < kPlaceColumns && !fault; ++i) {
          if (!layout->place[i]) continue;
          const double value = row[*layout->place[i]];
          if (!place[i]) place[i] = value;
          if (*place[i] == value) continue;
          fault = RowFault{*layout->place[i],
                           fmt::format("changes from {} to {}, but a static record is taken at "
                                       "one fixed pose",
                                       *place[i], value)};
        }
        if (!fault) samples.append(t_s, row);
        return fault;
      });
  if (!skipped) return fail(skipped.error());
  record.skipped_rows = *skipped;
  return record;
}

Result<std::vector<std::vector<double>>> read_columns(const std::filesystem::path& path,
                                                      const std::vector<std::string>& names) {
  auto file = CsvTable::open(path);
  if (!file) return fail(file.error());
  std::vector<bool> wanted(file->names().size(), false);
  std::vector<std::size_t> places;
  for (const std::string& name : names) {
    const auto column = file->require(name, fmt::format("{}", fmt::join(names, ", ")));
    if (!column) return fail(column.error());
    wanted[*column] = true;
    places.push_back(*column);
  }
  std::vector<std::vector<double>> columns(names.size());
  for (auto& column : columns) column.reserve(file->row_bound());
  const auto skipped = file->read(wanted, false, [&](std::span<const double> row) {
    for (std::size_t i = 0; i < places.size(); ++i) columns[i].push_back(row[places[i]]);
    return std::optional<RowFault>{};
  });
  if (!skipped) return fail(skipped.error());
  return columns;
}

}  // namespace plumbline::app
