#include <fmt/format.h>

#include <iostream>
#include <memory>

#include "app/command/command.h"
#include "app/config/run_description.h"
#include "app/io/csv.h"
#include "app/io/evaluation_json.h"
#include "app/io/output_folder.h"
#include "app/io/result_json.h"
#include "app/io/sha256.h"
#include "app/summary.h"

namespace plumbline::app {

namespace {

struct EvaluateOptions {
  std::string calibration;
  std::string samples;
  std::string config;
  std::string out;
  bool skip_bad_rows = false;
};

Result<void> check_same_unit(const std::string& calibrated, const std::string& described) {
  if (calibrated.empty() || described.empty() || calibrated == described) return {};
  return fail(ErrorCode::input,
              fmt::format("the calibration is of unit {}, the set of unit {}: evaluate needs "
                          "another set of the same unit",
                          calibrated, described));
}

Result<ExitCode> run_evaluate(const EvaluateOptions& options) {
  const auto description = read_run_description(options.config);
  if (!description) return fail(description.error());
  const auto calibration = read_result_json(options.calibration, description->reference_C);
  if (!calibration) return fail(calibration.error());
  if (auto same = check_same_unit(calibration->dut.serial, description->dut.serial); !same) {
    return fail(same.error());
  }
  const auto set = read_samples(options.samples, {.skip_bad_rows = options.skip_bad_rows});
  if (!set) return fail(set.error());
  auto folder = OutputFolder::prepare(options.out);
  if (!folder) return fail(folder.error());

  const Evaluation evaluation = evaluate(calibration->model, *set, *description);
  Provenance provenance{
      .dut = description->dut, .input_sha256 = {}, .created_utc = utc_now(), .seed = 1};
  for (const std::string& file : {options.calibration, options.samples, options.config}) {
    auto hash = sha256_of_file(file);
    if (!hash) return fail(hash.error());
    provenance.input_sha256.emplace_back(file, *std::move(hash));
  }
  const Json json = evaluation_json(evaluation, set->skipped_rows, description->limits, provenance);
  if (auto done = folder->write("evaluation.json", file_text(json)); !done) {
    return fail(done.error());
  }
  if (auto done = folder->publish(); !done) return fail(done.error());
  std::cout << evaluation_summary(evaluation, description->limits);
  return within_limits(evaluation, description->limits).value_or(true) ? ExitCode::done
                                                                       : ExitCode::limits_exceeded;
}

}  // namespace

void add_evaluate(CLI::App& program, Invocation& invocation) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* sub = program.add_subcommand(
      "evaluate", "Apply a calibration to another set of the same unit and report its errors");
  sub->add_option("--calibration", options->calibration, "result.json of the calibration")
      ->required();
  sub->add_option("--samples", options->samples,
                  "The other set (CSV as for calibrate; t_s on the clock of the calibration run)")
      ->required();
  sub->add_option("--config", options->config, "Description of the run (run.toml or rig.toml)")
      ->required();
  sub->add_option("--out", options->out, "Folder for evaluation.json; created when absent")
      ->required();
  sub->add_flag("--skip-bad-rows", options->skip_bad_rows,
                "Skip and count rows that cannot be used, instead of refusing the file");
  sub->footer(
      "Whether the head moved between the calibration run and the set is told from the readings; "
      "so is the way round it goes, where backlash was found and the run left that open. "
      "Exit codes: 0 done, within the limits if [limits] were given; 1 done, limits exceeded on at "
      "least one pose; 2 wrong use; 4 internal error.");
  sub->callback(
      [&invocation, options] { invocation.action = [options] { return run_evaluate(*options); }; });
}

}  // namespace plumbline::app
