#include <iostream>
#include <memory>

#include "app/calibration_job.h"
#include "app/command/command.h"

namespace plumbline::app {

namespace {

struct CalibrateOptions {
  CalibrationFiles files;
  std::string database;
  storage::RunId run = 0;
  std::string out;
  std::uint64_t seed = 1;
  bool scalar = false;
};

Result<CalibrationJob> job_of(const CalibrateOptions& options) {
  if (!options.database.empty()) {
    return job_from_database(options.database, options.run, options.seed);
  }
  if (options.files.samples.empty() || options.files.config.empty()) {
    return fail(ErrorCode::input,
                "calibrate needs either --samples and --config, or --run and --db; see plumbline "
                "calibrate --help");
  }
  return job_from_files(options.files, options.seed);
}

Result<ExitCode> run_calibrate(const CalibrateOptions& options) {
  if (options.scalar) {
    return fail(ErrorCode::input,
                "--scalar: calibration without angles is not in this version yet");
  }
  const auto job = job_of(options);
  if (!job) return fail(job.error());
  const auto outcome = perform(*job, options.out);
  if (!outcome) return fail(outcome.error());
  std::cout << outcome->summary;
  return outcome->exit_code;
}

}  // namespace

void add_calibrate(CLI::App& program, Invocation& invocation) {
  auto options = std::make_shared<CalibrateOptions>();
  CLI::App* sub = program.add_subcommand(
      "calibrate", "Estimate the parameters of a unit from measured poses, with a certificate");
  auto* samples = sub->add_option("--samples", options->files.samples,
                                  "Measured poses (CSV: t_s, pose, delta_deg, h_deg, ux_V, uy_V, "
                                  "uz_V and further columns)");
  auto* static_record =
      sub->add_option("--static", options->files.static_record,
                      "Record at one fixed pose, for the noise (CSV: t_s, ux_V, uy_V, uz_V); "
                      "without it the noise is taken from the dwells")
          ->needs(samples);
  auto* config = sub->add_option("--config", options->files.config,
                                 "Description of the run (run.toml or rig.toml)")
                     ->needs(samples);
  sub->add_flag("--skip-bad-rows", options->files.skip_bad_rows,
                "Skip and count rows that cannot be used, instead of refusing the file")
      ->needs(samples);
  auto* run = sub->add_option("--run", options->run, "Number of a stored run, instead of files");
  auto* database = sub->add_option("--db", options->database, "Database that holds the run");
  run->needs(database)->excludes(samples);
  database->needs(run)->excludes(samples)->excludes(static_record)->excludes(config);
  sub->add_option("--out", options->out,
                  "Folder for result.json and the certificate; created when absent")
      ->required();
  sub->add_option("--seed", options->seed, "Seed of everything random (default 1)");
  sub->add_flag("--scalar", options->scalar, "Calibrate without angles (not in this version yet)");
  sub->footer(
      "With --run, verification poses of the run are evaluated too (evaluation.json). The folder "
      "receives all files or, on failure, none.\n"
      "Exit codes: 0 done, within the limits if [limits] were given; 1 done, limits exceeded; 2 "
      "wrong use; 4 internal error.");
  sub->callback([&invocation, options] {
    invocation.action = [options] { return run_calibrate(*options); };
  });
}

}  // namespace plumbline::app
