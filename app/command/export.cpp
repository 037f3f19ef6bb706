// `plumbline export`: a recorded run as files, which calibrate to the same result as the run
// itself.
#include <fmt/format.h>

#include <iostream>
#include <memory>

#include "app/command/command.h"
#include "app/io/csv_writer.h"
#include "app/io/files.h"
#include "storage/run_store.h"

namespace plumbline::app {

namespace {

struct ExportOptions {
  std::string database;
  storage::RunId run = 0;
  std::string samples;
  std::string static_record;
  std::string confirm;
  std::string config;
};

/// Every request is checked before the first file is written.
Result<void> check_present(const ExportOptions& options, const storage::StoredRun& run) {
  const auto lacks = [&](const char* what) {
    return fail(ErrorCode::input,
                fmt::format("{}: run {} has no {}", options.database, options.run, what));
  };
  if (run.grid.poses.empty()) return lacks("pose of the grid");
  if (!options.static_record.empty() && run.soak.size() == 0) {
    return lacks("static record; leave out --static");
  }
  if (!options.confirm.empty() && run.verification.poses.empty()) {
    return lacks("verification poses; leave out --confirm");
  }
  return {};
}

Result<void> write_files(const ExportOptions& options, const storage::StoredRun& run) {
  if (auto done = write_samples(options.samples, run.grid); !done) return done;
  if (!options.static_record.empty()) {
    if (auto done = write_static(options.static_record, run.soak); !done) return done;
  }
  if (!options.confirm.empty()) {
    if (auto done = write_samples(options.confirm, run.verification); !done) return done;
  }
  if (!options.config.empty()) {
    return write_file_atomically(options.config, run.summary.header.config_toml);
  }
  return {};
}

std::string summary_of(const ExportOptions& options, const storage::StoredRun& run) {
  std::string text = fmt::format("run {} ({}, {}): {} poses, {} samples to {}\n", run.summary.id,
                                 run.summary.header.serial, to_string(run.summary.state),
                                 run.grid.poses.size(), run.grid.samples.size(), options.samples);
  for (const std::string& column : run.left_out) {
    text += fmt::format("left out: {}, not recorded throughout\n", column);
  }
  return text;
}

Result<ExitCode> export_run(const ExportOptions& options) {
  const auto store = storage::RunStore::open_read_only(options.database);
  if (!store) return fail(store.error());
  const auto run = store->load(options.run);
  if (!run) return fail(run.error());
  if (auto present = check_present(options, *run); !present) return fail(present.error());
  if (auto done = write_files(options, *run); !done) return fail(done.error());
  std::cout << summary_of(options, *run);
  return ExitCode::done;
}

}  // namespace

void add_export(CLI::App& program, Invocation& invocation) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* sub = program.add_subcommand("export", "Write a recorded run as measurement files");
  sub->add_option("--db", options->database, "The run database")->required();
  sub->add_option("--run", options->run, "Number of the run; `plumbline runs` lists them")
      ->required();
  sub->add_option("--out", options->samples, "Receives the poses of the grid (samples.csv)")
      ->required();
  sub->add_option("--static", options->static_record, "Receives the static record");
  sub->add_option("--confirm", options->confirm, "Receives the verification poses");
  sub->add_option("--config", options->config, "Receives the configuration of the run");
  sub->callback(
      [&invocation, options] { invocation.action = [options] { return export_run(*options); }; });
}

}  // namespace plumbline::app
