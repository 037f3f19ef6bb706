// `plumbline dry-run`: a whole calibration of a simulated unit over real wires.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include "app/command/certificate_options.h"
#include "app/command/command.h"
#include "app/command/measure.h"
#include "app/command/station_options.h"
#include "app/config/rig_description.h"
#include "app/io/read_file.h"
#include "app/sequencer/simulated_rig.h"

extern const char kExampleRig[];    // app/examples/rig.toml
extern const char kDefaultWorld[];  // rig/sim/worlds/default.toml

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

struct DryRunArguments {
  std::string out;
  std::string config;
  std::string world;
  double speed = 60;
  std::uint64_t seed = 1;
  std::string database;
  std::string serial;
  std::string operator_name;
  CertificateOptions certificate;
  ServeOptions serve;
  std::string effects;
  bool separate = false;
};

Result<RigDescription> rig_description(const DryRunArguments& arguments) {
  if (arguments.config.empty()) {
    return parse_rig_description(kExampleRig, "built-in rig.toml");
  }
  return read_rig_description(arguments.config);
}

Result<ExitCode> dry_run(const DryRunArguments& arguments) {
  auto rig = rig_description(arguments);
  if (!rig) return fail(rig.error());
  if (!arguments.serial.empty()) rig->run.dut.serial = arguments.serial;
  const auto style = certificate_style(arguments.certificate);
  if (!style) return fail(style.error());
  std::string world = kDefaultWorld;
  if (!arguments.world.empty()) {
    auto text = read_file(arguments.world);
    if (!text) return fail(text.error());
    world = *std::move(text);
  }
  std::error_code error;
  fs::create_directories(arguments.out, error);
  if (error) {
    return fail(ErrorCode::output,
                fmt::format("{}: cannot be made a folder ({})", arguments.out, error.message()));
  }
  const auto simulated =
      SimulatedRig::start({.world_toml = world, .speed = arguments.speed, .seed = arguments.seed});
  if (!simulated) return fail(simulated.error());
  rig->head.modbus = simulated->modbus();
  rig->sensor.can = simulated->can();
  // As often in the rig's time as on a real rig, as far as the machine allows.
  const double poll_ms = static_cast<double>(rig->head.poll_interval.count()) / arguments.speed;
  rig->head.poll_interval = std::chrono::milliseconds(std::max(1L, std::lround(poll_ms)));
  fmt::print(stderr, "dry-run: simulated rig on {} and {}, {} times real time\n",
             simulated->modbus(), simulated->can(), arguments.speed);
  const std::string hint = fmt::format("plumbline dry-run --out {} (a new run)", arguments.out);
  const fs::path database = arguments.database.empty() ? fs::path(arguments.out) / "run.db"
                                                       : fs::path(arguments.database);
  const auto station = station_of_run(arguments.serve, database, arguments.out);
  if (!station) return fail(station.error());
  auto code = measure_and_calibrate({.session = {.rig = *rig,
                                                 .database = database,
                                                 .out = arguments.out,
                                                 .resume = false,
                                                 .operator_name = arguments.operator_name},
                                     .out = arguments.out,
                                     .seed = arguments.seed,
                                     .style = *style,
                                     .separate = arguments.separate,
                                     .effects = arguments.effects,
                                     .resume_hint = hint});
  if (*station) (*station)->let_viewers_see_the_end();
  return code;
}

}  // namespace

void add_dry_run(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand(
      "dry-run", "a whole calibration of a simulated unit over real wires, with certificate");
  auto arguments = std::make_shared<DryRunArguments>();
  sub->add_option("--out", arguments->out, "folder for run.db, results and certificate")
      ->required();
  sub->add_option("--config", arguments->config, "rig.toml instead of the built-in one");
  sub->add_option("--world", arguments->world, "world.toml instead of the built-in one");
  sub->add_option("--speed", arguments->speed, "world seconds in one second")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  sub->add_option("--seed", arguments->seed, "of everything random in the world and the results")
      ->capture_default_str();
  sub->add_option("--db", arguments->database, "run database instead of run.db in that folder");
  sub->add_option("--serial", arguments->serial, "of the unit, instead of the one in rig.toml");
  sub->add_option("--operator", arguments->operator_name, "who measures; noted with the run");
  sub->add_flag("--separate", arguments->separate,
                "measure at once, in the same run, the poses that tell effects apart, and decide "
                "again");
  sub->add_option("--effects", arguments->effects,
                  "effects of your own, searched for like the listed ones (TOML)");
  add_certificate_options(*sub, arguments->certificate);
  add_serve_options(*sub, arguments->serve);
  sub->callback([arguments, &invocation] {
    invocation.action = [arguments] { return dry_run(*arguments); };
  });
}

}  // namespace plumbline::app
