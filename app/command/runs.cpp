// `plumbline runs`: lists what a run database holds.
#include <fmt/format.h>

#include <iostream>
#include <memory>

#include "app/command/command.h"
#include "app/io/json.h"
#include "storage/run_store.h"

namespace plumbline::app {

namespace {

struct RunsOptions {
  std::string database;
  bool json = false;
};

Json runs_json(const std::vector<storage::RunSummary>& runs) {
  Json list = Json::array();
  for (const storage::RunSummary& run : runs) {
    list.push_back({{"id", run.id},
                    {"serial", run.header.serial},
                    {"state", to_string(run.state)},
                    {"started_utc", run.header.started_utc},
                    {"finished_utc", run.finished_utc.empty() ? Json() : Json(run.finished_utc)},
                    {"poses", run.poses},
                    {"samples", run.samples},
                    {"rate_hz", json_number(run.header.rate_hz)},
                    {"program_version", run.header.program_version}});
  }
  return {{"schema", "plumbline.runs/1"}, {"runs", list}};
}

std::string runs_text(const std::vector<storage::RunSummary>& runs) {
  if (runs.empty()) return "no run has been recorded\n";
  std::string text = fmt::format("{:>4}  {:<20}  {:<16}  {:<8}  {:>5}  {:>9}\n", "run", "started",
                                 "serial", "state", "poses", "samples");
  for (const storage::RunSummary& run : runs) {
    text +=
        fmt::format("{:>4}  {:<20}  {:<16}  {:<8}  {:>5}  {:>9}\n", run.id, run.header.started_utc,
                    run.header.serial, to_string(run.state), run.poses, run.samples);
  }
  return text;
}

Result<ExitCode> list_runs(const RunsOptions& options) {
  const auto store = storage::RunStore::open_read_only(options.database);
  if (!store) return fail(store.error());
  const auto runs = store->runs();
  if (!runs) return fail(runs.error());
  std::cout << (options.json ? file_text(runs_json(*runs)) : runs_text(*runs));
  return ExitCode::done;
}

}  // namespace

void add_runs(CLI::App& program, Invocation& invocation) {
  auto options = std::make_shared<RunsOptions>();
  CLI::App* sub = program.add_subcommand("runs", "List the runs in a database");
  sub->add_option("--db", options->database, "The run database")->required();
  sub->add_flag("--json", options->json, "As JSON, for other programs");
  sub->callback(
      [&invocation, options] { invocation.action = [options] { return list_runs(*options); }; });
}

}  // namespace plumbline::app
