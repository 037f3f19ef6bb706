// `plumbline serve`: the station page over a run database, with or without a run going on.
#include <fmt/format.h>
#include <signal.h>

#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "app/command/certificate_options.h"
#include "app/command/command.h"
#include "app/command/station_options.h"
#include "app/config/rig_description.h"
#include "rig/strict_toml.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

struct ServeArguments {
  std::string database;
  std::string results;
  ServeOptions serve;
  std::vector<std::string> configs;
  bool simulate = false;
  std::string simulated_config;
  double speed = 60;
  std::string golden;
  std::string tolerances;
  CertificateOptions certificate;
};

/// A table for each parameter that has limits: [K_xx] min = 0.9, max = 1.1.
Result<std::map<std::string, Tolerance>> read_tolerances(const fs::path& path) {
  auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  rig::StrictTable root = file->root();
  std::map<std::string, Tolerance> tolerances;
  std::vector<std::string> names;
  for (const char* axis : kAxisName) {
    for (const char* input : kAxisName) names.push_back(fmt::format("K_{}{}", axis, input));
    names.push_back(fmt::format("U0_{}", axis));
  }
  for (const std::string& name : names) {
    rig::StrictTable table = root.table(name);
    if (!table.present()) continue;
    Tolerance& tolerance = tolerances[name];
    if (table.has("min")) tolerance.lower = table.number("min");
    if (table.has("max")) tolerance.upper = table.number("max");
  }
  if (auto done = file->finish(); !done) return fail(done.error());
  return tolerances;
}

Result<std::vector<StationPlan>> plans_of(const ServeArguments& arguments) {
  std::vector<StationPlan> plans;
  if (!arguments.serve.control) return plans;
  // A configuration that is wrong is known now, not when an operator starts it.
  for (const std::string& config : arguments.configs) {
    if (auto rig = read_rig_description(config); !rig) return fail(rig.error());
    plans.push_back({.name = fs::path(config).filename().string(), .config = fs::absolute(config)});
  }
  if (arguments.simulate) {
    StationPlan plan{.name = "dry run (simulated unit)", .simulated = true};
    plan.speed = arguments.speed;
    if (!arguments.simulated_config.empty()) {
      if (auto rig = read_rig_description(arguments.simulated_config); !rig) {
        return fail(rig.error());
      }
      plan.config = fs::absolute(arguments.simulated_config);
    }
    plans.push_back(plan);
  }
  return plans;
}

Result<ExitCode> serve(const ServeArguments& arguments) {
  auto guard = guard_options(arguments.serve);
  if (!guard) return fail(guard.error());
  auto plans = plans_of(arguments);
  if (!plans) return fail(plans.error());
  if (auto style = certificate_style(arguments.certificate); !style) return fail(style.error());
  const fs::path database = fs::absolute(arguments.database);
  const fs::path results =
      arguments.results.empty() ? database.parent_path() : fs::absolute(arguments.results);
  StationOptions options{.guard = *std::move(guard),
                         .history = {.database = database, .results = results},
                         .launcher = {}};
  options.history.golden = arguments.golden;
  if (!arguments.tolerances.empty()) {
    auto tolerances = read_tolerances(arguments.tolerances);
    if (!tolerances) return fail(tolerances.error());
    options.history.tolerances = *std::move(tolerances);
  }
  options.launcher.database = database;
  options.launcher.results = results;
  options.launcher.plans = *std::move(plans);
  options.launcher.language = arguments.certificate.language;
  if (!arguments.certificate.laboratory.empty()) {
    options.launcher.laboratory = fs::absolute(arguments.certificate.laboratory);
  }
  // Signals are waited for here; the server's threads inherit that they are blocked.
  sigset_t ends;
  sigemptyset(&ends);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ends, number);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  auto station = Station::start(options);
  if (!station) return fail(station.error());
  std::cout << fmt::format("station: http://{}/\n", (*station)->address().text()) << std::flush;
  int number = 0;
  sigwait(&ends, &number);
  return ExitCode::done;
}

}  // namespace

void add_serve(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand(
      "serve", "station page in the browser: what goes on at the rig and what was measured");
  auto arguments = std::make_shared<ServeArguments>();
  sub->add_option("--db", arguments->database, "run database; read only")->required();
  sub->add_option("--results", arguments->results,
                  "folder with the results of its runs (default: the database's own)");
  add_listen_options(*sub, arguments->serve);
  sub->add_option("--config", arguments->configs,
                  "rig.toml that operators may start with --control; may be repeated");
  sub->add_flag("--simulate", arguments->simulate,
                "operators may start dry runs on a simulated rig, too");
  sub->add_option("--simulated-config", arguments->simulated_config,
                  "rig.toml for dry runs instead of the built-in one")
      ->needs("--simulate");
  sub->add_option("--speed", arguments->speed, "of dry runs: world seconds in one second")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  sub->add_option("--golden", arguments->golden,
                  "serial of the golden unit, which has a trend of its own");
  sub->add_option("--tolerances", arguments->tolerances,
                  "TOML with a table [K_xx] min = …, max = … for each parameter that has limits");
  add_certificate_options(*sub, arguments->certificate);
  sub->callback(
      [arguments, &invocation] { invocation.action = [arguments] { return serve(*arguments); }; });
}

}  // namespace plumbline::app
