#include <fmt/format.h>

#include <iostream>
#include <iterator>
#include <memory>

#include "app/axis_columns.h"
#include "app/command/command.h"
#include "app/config/run_description.h"
#include "app/io/csv.h"
#include "app/io/files.h"
#include "app/io/result_json.h"
#include "app/summary.h"
#include "estimator/correct.h"

namespace plumbline::app {

namespace {

struct CorrectOptions {
  std::string calibration;
  std::string samples;
  std::string config;
  std::string out;
  std::string columns = "x=ux_V,y=uy_V,z=uz_V";
  bool skip_bad_rows = false;
};

/// What the reader of corrected readings has to know, one line each.
std::vector<std::string> cautions_of(const Corrected& corrected, std::size_t skipped_rows) {
  std::vector<std::string> cautions;
  if (skipped_rows > 0) cautions.push_back(counted(skipped_rows, "bad row") + " skipped");
  if (auto text = caution(corrected.lacking, corrected.left_out); !text.empty())
    cautions.push_back(std::move(text));
  for (const BeyondRange& column : corrected.beyond) cautions.push_back(caution(column));
  const auto per_axis = [&](const PerAxis<std::size_t>& counts, const char* what) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      if (counts[i] == 0) continue;
      cautions.push_back(fmt::format("caution: {} axis: {} {}", kAxisName[i],
                                     counted(counts[i], "reading"), what));
    }
  };
  per_axis(corrected.at_rail, "at an end of the converter's range or beyond it");
  per_axis(corrected.beyond_1g, "beyond ±1 g, where the unit was not calibrated");
  return cautions;
}

Result<ExitCode> run_correct(const CorrectOptions& options) {
  const auto description = read_run_description(options.config);
  if (!description) return fail(description.error());
  const auto calibration = read_result_json(options.calibration, description->reference_C);
  if (!calibration) return fail(calibration.error());
  const std::string& serial = description->dut.serial;
  if (!serial.empty() && !calibration->dut.serial.empty() && serial != calibration->dut.serial) {
    return fail(ErrorCode::input,
                fmt::format("the calibration is of unit {}, the readings of unit {}",
                            calibration->dut.serial, serial));
  }
  const auto columns = parse_axis_columns(options.columns);
  if (!columns) return fail(columns.error());
  if (columns->size() != kAxisCount)
    return fail(ErrorCode::input, "--columns: a correction needs all three axes");
  for (std::size_t i = 1; i < kAxisCount; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if ((*columns)[i].column == (*columns)[j].column)
        return fail(ErrorCode::input,
                    fmt::format("--columns: {} cannot be two axes", (*columns)[i].column));
    }
  }
  CsvOptions csv{.skip_bad_rows = options.skip_bad_rows, .angle_free = true};
  for (const AxisColumn& column : *columns) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      if (column.axis == kAxisName[i]) csv.axis_columns[i] = column.column;
    }
  }
  const auto readings = read_samples(options.samples, csv);
  if (!readings) return fail(readings.error());

  const Corrected corrected = correct_readings(calibration->model, readings->samples, *description);
  const std::string applied = fmt::format("{}", fmt::join(corrected.applied, ", "));
  const std::string left_out = fmt::format("{}", fmt::join(corrected.left_out, ", "));
  const std::vector<std::string> cautions = cautions_of(corrected, readings->skipped_rows);
  std::string text =
      fmt::format("# specific force in the frame of the triad; effects applied: {}; left out: {}\n",
                  applied.empty() ? "none" : applied, left_out.empty() ? "none" : left_out);
  for (const std::string& caution : cautions) text += "# " + caution + '\n';
  text += "t_s,ax_mps2,ay_mps2,az_mps2\n";
  for (std::size_t k = 0; k < corrected.a_mps2.size(); ++k) {
    const Eigen::Vector3d& a = corrected.a_mps2[k];
    fmt::format_to(std::back_inserter(text), "{},{},{},{}\n", readings->samples.t_s[k], a.x(),
                   a.y(), a.z());
  }
  if (auto done = write_file_atomically(options.out, text); !done) return fail(done.error());
  std::cout << fmt::format("{} readings corrected; effects applied: {}; left out: {}\n",
                           corrected.a_mps2.size(), applied.empty() ? "none" : applied,
                           left_out.empty() ? "none" : left_out);
  for (const std::string& caution : cautions) std::cout << caution << '\n';
  return ExitCode::done;
}

}  // namespace

void add_correct(CLI::App& program, Invocation& invocation) {
  auto options = std::make_shared<CorrectOptions>();
  CLI::App* sub = program.add_subcommand(
      "correct", "Apply a calibration to readings: output voltages to specific force");
  sub->add_option("--calibration", options->calibration, "result.json of the calibration")
      ->required();
  sub->add_option("--samples", options->samples,
                  "The readings (CSV: t_s on the clock of the calibration run, ux_V, uy_V, uz_V; "
                  "temp_C and further columns where effects need them)")
      ->required();
  sub->add_option("--config", options->config, "Description of the run (run.toml or rig.toml)")
      ->required();
  sub->add_option("--out", options->out, "File that receives t_s, ax_mps2, ay_mps2, az_mps2 (CSV)")
      ->required();
  sub->add_option("--columns", options->columns,
                  "Which column is which axis (default x=ux_V,y=uy_V,z=uz_V)");
  sub->add_flag("--skip-bad-rows", options->skip_bad_rows,
                "Skip and count rows that cannot be used, instead of refusing the file");
  sub->footer(
      "Effects of the head and the base, of what came before a reading and of one run are left "
      "out; which ones, the first line of the file says. Further lines with # say what else to "
      "know: a column that is lacking or lies beyond the calibrated range, readings at an end of "
      "the converter's range or beyond ±1 g.\n"
      "Exit codes: 0 done; 2 wrong use; 4 internal error.");
  sub->callback(
      [&invocation, options] { invocation.action = [options] { return run_correct(*options); }; });
}

}  // namespace plumbline::app
