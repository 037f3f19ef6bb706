// plumbline-simrig: the simulated rig as a program of its own, reached only over its wires.
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <string>
#include <utility>

#include "rig/sim/can_node.h"
#include "rig/sim/machine.h"
#include "rig/sim/modbus_server.h"
#include "rig/sim/ready_file.h"
#include "rig/sim/record.h"
#include "rig/sim/world.h"

namespace plumbline::sim {
namespace {

struct Options {
  std::filesystem::path world;
  std::string modbus;
  std::string can;
  double speed = 1;
  std::uint64_t seed = 1;
  std::filesystem::path ready_file;
  bool exit_with_parent = false;

  std::filesystem::path record;  ///< folder of a recorded set; empty: serve the wires
  std::filesystem::path plan;
  RecordOptions recording;
};

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::input:
    case ErrorCode::output:
      return 2;
    case ErrorCode::rig:
    case ErrorCode::storage:
      return 3;
    case ErrorCode::internal:
      break;
  }
  return 4;
}

/// SIGTERM and SIGINT, blocked in every thread and fetched by the main one, so that ending is
/// ordinary code and not a signal handler.
sigset_t block_ending_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

Result<void> serve(const Options& options, const sigset_t& ending) {
  auto world = read_world(options.world);
  if (!world) return fail(world.error());
  auto output = open_frame_output(options.can);
  if (!output) return fail(output.error());

  Machine machine(Drive(world->drive, world->faults, options.seed), Unit(*world, options.seed),
                  options.speed);
  auto modbus = ModbusServer::open(options.modbus, world->drive.unit_id, machine, world->faults,
                                   options.seed);
  if (!modbus) return fail(modbus.error());
  const CanNode node(machine, std::move(*output),
                     NodeFrames(world->rate_hz, world->adc.bits, world->faults, options.seed,
                                world->node_serial_number));
  if (!options.ready_file.empty()) {
    auto written = write_ready_file(options.ready_file, (*modbus)->endpoint(), node.endpoint());
    if (!written) return written;
  }
  fmt::print("plumbline-simrig: {} on {} and {}, {:g} times real time; Ctrl-C ends it\n",
             options.world.string(), (*modbus)->endpoint(), node.endpoint(), options.speed);
  std::fflush(stdout);

  const timespec interval{.tv_sec = 0, .tv_nsec = 100'000'000};
  while (sigtimedwait(&ending, nullptr, &interval) < 0) {
    if (auto failure = node.failure()) return fail(*failure);
  }
  std::error_code ignored;
  if (!options.ready_file.empty()) std::filesystem::remove(options.ready_file, ignored);
  return {};
}

Result<void> record_to_files(Options& options) {
  auto world = read_world(options.world);
  if (!world) return fail(world.error());
  options.recording.seed = options.seed;
  if (!options.plan.empty()) {
    auto plan = read_plan(options.plan);
    if (!plan) return fail(plan.error());
    options.recording.plan = std::move(*plan);
  }
  return record(*world, options.recording, options.record);
}

/// The group of options that go with --record.
void add_record_options(CLI::App& app, Options& options) {
  const std::map<std::string, RecordOrder> orders = {{"raster", RecordOrder::raster},
                                                     {"snake", RecordOrder::snake},
                                                     {"spiral", RecordOrder::spiral},
                                                     {"random", RecordOrder::random}};
  RecordOptions& recording = options.recording;
  auto* folder = app.add_option("--record", options.record,
                                "no wires: write a whole recorded set into this folder");
  const auto add = [&](const char* name, auto& value, const char* text) {
    return app.add_option(name, value, text)->needs(folder)->capture_default_str();
  };
  add("--plan", options.plan, "positions to visit, as `plumbline plan` prints them");
  add("--order", recording.order, "raster, snake, spiral or random")
      ->transform(CLI::CheckedTransformer(orders).description(""));
  add("--samples-per-pose", recording.samples_per_pose, "samples taken at each position")
      ->check(CLI::Range(1, 1'000'000));
  add("--soak", recording.soak_s, "seconds at rest before the grid")->check(CLI::Range(0.0, 1e6));
  add("--verification-poses", recording.verification_poses, "random poses after the grid")
      ->check(CLI::Range(0, 100'000));
  add("--settle", recording.settle_s, "seconds waited after every move")
      ->check(CLI::Range(0.0, 1e4));
}

int run(int argc, char** argv) {
  const pid_t parent = getppid();
  const sigset_t ending = block_ending_signals();
  CLI::App app{
      "Simulated calibration rig: a motor drive on Modbus and an accelerometer node on CAN.",
      "plumbline-simrig"};
  app.set_version_flag("--version", "plumbline-simrig " PLUMBLINE_VERSION);
  Options options;
  app.add_option("--world", options.world, "world file (TOML): unit, noise, effects, faults")
      ->required();
  app.add_option("--modbus", options.modbus, "tcp:ADDRESS:PORT (port 0: any free one) or rtu:LINK");
  app.add_option("--can", options.can, "unix:PATH or can:INTERFACE");
  app.add_option("--speed", options.speed,
                 "world seconds in one second, at most: the world waits for a machine that is busy")
      ->check(CLI::Range(0.001, 10000.0));
  app.add_option("--seed", options.seed, "of everything random");
  app.add_option("--ready-file", options.ready_file,
                 "written with the real endpoints once it serves");
  app.add_flag("--exit-with-parent", options.exit_with_parent,
               "end when the program that started this one ends");
  add_record_options(app, options);
  try {
    app.parse(argc, argv);
    if (options.record.empty() && (options.modbus.empty() || options.can.empty())) {
      throw CLI::RequiredError("--modbus and --can, or --record");
    }
  } catch (const CLI::Success& wanted) {  // --help, --version
    return app.exit(wanted);
  } catch (const CLI::ParseError& error) {
    fmt::print(stderr, "plumbline-simrig: {}; see plumbline-simrig --help\n", error.what());
    return exit_code(ErrorCode::input);
  }

  if (options.exit_with_parent) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) return 0;  // it ended before we could ask to be told
  }
  const auto done = options.record.empty() ? serve(options, ending) : record_to_files(options);
  if (!done) {
    fmt::print(stderr, "plumbline-simrig: {}\n", done.error().message);
    return exit_code(done.error().code);
  }
  return 0;
}

}  // namespace
}  // namespace plumbline::sim

int main(int argc, char** argv) {
  try {
    return plumbline::sim::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "plumbline-simrig: {}\n", error.what());
    return 4;
  }
}
