#include <iostream>
#include <memory>

#include "app/calibration_job.h"
#include "app/command/certificate_options.h"
#include "app/command/command.h"
#include "app/scalar_job.h"

namespace plumbline::app {

namespace {

struct CalibrateOptions {
  CalibrationFiles files;
  std::string database;
  storage::RunId run = 0;
  std::string out;
  std::string effects;
  std::uint64_t seed = 1;
  bool scalar = false;
  ScalarFiles scalar_files;
  CertificateOptions certificate;
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

Result<ExitCode> run_scalar(const CalibrateOptions& options) {
  if (options.files.samples.empty() || options.files.config.empty()) {
    return fail(ErrorCode::input, "calibrate --scalar needs --samples and --config");
  }
  const auto style = certificate_style(options.certificate);
  if (!style) return fail(style.error());
  ScalarFiles files = options.scalar_files;
  files.samples = options.files.samples;
  files.config = options.files.config;
  files.skip_bad_rows = options.files.skip_bad_rows;
  const auto outcome = calibrate_scalar_files(files, *style, options.out, options.seed);
  if (!outcome) return fail(outcome.error());
  std::cout << outcome->summary;
  return outcome->exit_code;
}

Result<ExitCode> run_calibrate(const CalibrateOptions& options) {
  if (options.scalar) return run_scalar(options);
  auto style = certificate_style(options.certificate);
  if (!style) return fail(style.error());
  auto job = job_of(options);
  if (!job) return fail(job.error());
  job->style = *std::move(style);
  if (auto added = add_own_effects(options.effects, *job); !added) return fail(added.error());
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
  auto* effects =
      sub->add_option("--effects", options->effects,
                      "Effects of your own to be searched for like the listed ones (TOML; "
                      "app/examples/effects.toml is one to start from)");
  add_certificate_options(*sub, options->certificate);
  sub->add_option("--seed", options->seed, "Seed of everything random (default 1)");
  auto* scalar =
      sub->add_flag("--scalar", options->scalar,
                    "Calibrate without angles, from |a| = g at rest in many attitudes (nine "
                    "parameters; with angles in the file the head is cross-checked)")
          ->needs(samples)
          ->needs(config)
          ->excludes(static_record)
          ->excludes(effects);
  sub->add_option("--columns", options->scalar_files.columns,
                  "With --scalar: which column is which axis, as in x=ax_raw,y=ay_raw,z=az_raw "
                  "(default x=ux_V,y=uy_V,z=uz_V)")
      ->needs(scalar);
  sub->add_flag("--detect-static", options->scalar_files.detect_static,
                "With --scalar: cut a continuous record into rests; at rest is where, " +
                    rest_detector_words())
      ->needs(scalar);
  sub->add_option("--rate", options->scalar_files.rate_hz,
                  "With --scalar: sample rate in Hz of a file without the column t_s")
      ->needs(scalar)
      ->check(CLI::PositiveNumber);
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
