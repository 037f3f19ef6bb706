#include "app/scalar_job.h"

#include <fmt/format.h>

#include "app/axis_columns.h"
#include "app/certificate/certificate_files.h"
#include "app/certificate/scalar_results.h"
#include "app/config/run_description.h"
#include "app/io/csv.h"
#include "app/io/csv_table.h"
#include "app/io/output_folder.h"
#include "app/io/scalar_json.h"
#include "app/io/sha256.h"
#include "app/issue_time.h"
#include "app/scalar_summary.h"
#include "estimator/scalar/rest_detector.h"

namespace plumbline::app {

namespace {

Result<PerAxis<std::string>> columns_of(const std::string& text) {
  PerAxis<std::string> columns = CsvOptions{}.axis_columns;
  if (text.empty()) return columns;
  const auto parsed = parse_axis_columns(text);
  if (!parsed) return fail(parsed.error());
  if (parsed->size() != kAxisCount) {
    return fail(ErrorCode::input,
                "--columns: a calibration without angles needs all three axes, as in "
                "x=ax_raw,y=ay_raw,z=az_raw");
  }
  for (const AxisColumn& column : *parsed) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      if (column.axis == kAxisName[i]) columns[i] = column.column;
    }
  }
  return columns;
}

/// The set with rests as poses, and how they were found.
struct Rests {
  MeasurementSet set;
  std::string how;
};

Result<Rests> read_rests(const ScalarFiles& files, const PerAxis<std::string>& columns) {
  const std::string name = files.samples.string();
  CsvOptions options{.skip_bad_rows = files.skip_bad_rows,
                     .axis_columns = columns,
                     .angle_free = true,
                     .rate_hz = files.rate_hz};
  std::string how;
  if (options.rate_hz == 0) {
    const auto file = CsvTable::open(files.samples);
    if (!file) return fail(file.error());
    if (!file->find("t_s") && file->find("pose") && !files.detect_static) {
      options.rate_hz = 1;
      how =
          "; no column t_s: readings are counted as one a second, so that times and rates mean "
          "the order only";
    }
  }
  auto set = read_samples(files.samples, options);
  if (!set) return fail(set.error());
  Rests rests{*std::move(set), {}};
  if (files.detect_static) {
    rests.set.poses = find_rests(rests.set.samples);
    rests.set.has_angles = false;
    if (rests.set.poses.empty()) {
      return fail(ErrorCode::input,
                  name + ": no interval at rest found; the detector: " + rest_detector_words());
    }
    rests.how = fmt::format("{} rests found in a continuous record by the detector: {}",
                            rests.set.poses.size(), rest_detector_words());
    return rests;
  }
  if (rests.set.poses.empty()) {
    return fail(ErrorCode::input,
                name +
                    ": there is no column pose that tells the rests apart; for a continuous "
                    "record add --detect-static");
  }
  rests.how = "one rest for each number in the column pose" + how;
  return rests;
}

}  // namespace

std::string rest_detector_words() {
  const RestOptions options;
  return fmt::format(
      "in a window of {} s about every sample the variance of no axis exceeds {} times its quiet "
      "variance (the 20 % quantile over windows side by side), for at least {} s on end",
      options.window_s, options.factor, options.shortest_s);
}

Result<ScalarOutcome> calibrate_scalar_files(const ScalarFiles& files,
                                             const CertificateStyle& style,
                                             const std::filesystem::path& out, std::uint64_t seed) {
  const auto columns = columns_of(files.columns);
  if (!columns) return fail(columns.error());
  const auto description = read_run_description(files.config);
  if (!description) return fail(description.error());
  const auto rests = read_rests(files, *columns);
  if (!rests) return fail(rests.error());
  auto folder = OutputFolder::prepare(out);
  if (!folder) return fail(folder.error());

  auto calibration = calibrate_scalar({rests->set, *description}, {.seed = seed});
  if (!calibration) {
    return fail(calibration.error().code,
                files.samples.string() + ": " + calibration.error().message);
  }
  Provenance provenance{
      .dut = description->dut, .input_sha256 = {}, .created_utc = issue_time_utc(), .seed = seed};
  for (const auto& file : {files.samples, files.config}) {
    auto hash = sha256_of_file(file);
    if (!hash) return fail(hash.error());
    provenance.input_sha256.emplace_back(file.string(), *std::move(hash));
  }
  const ScalarSource source{rests->how, unit_of_column((*columns)[0]), *columns};
  const Json json = scalar_json(*calibration, source, provenance);
  const std::string result = file_text(json);
  if (auto done = folder->write("result.json", result); !done) return fail(done.error());
  const Calibration shared = shared_chapters(*calibration);
  const ScalarResults scalar{*calibration, source};
  CertificateInput input{*description, shared, provenance, nullptr, {}};
  input.laboratory = style.laboratory;
  input.language = style.language;
  input.result_sha256 = sha256(result);
  input.signing = style.signing ? &*style.signing : nullptr;
  input.scalar = &scalar;
  if (auto done = write_certificate(input, *folder); !done) return fail(done.error());
  if (auto done = folder->publish(); !done) return fail(done.error());

  ScalarOutcome outcome{*std::move(calibration), ExitCode::done, {}};
  const DecisionStatus status = outcome.calibration.decision.status;
  if (status == DecisionStatus::fail || status == DecisionStatus::conditional_fail) {
    outcome.exit_code = ExitCode::limits_exceeded;
  }
  outcome.summary = scalar_summary(*description, outcome.calibration, source);
  return outcome;
}

}  // namespace plumbline::app
