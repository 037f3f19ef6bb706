// The program `plumbline`: command line in, exit code out. What the commands do is in command/.
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <system_error>
#include <vector>

#include "app/command/command.h"
#include "app/exit_code.h"
#include "app/provenance.h"
#include "estimator/linear_algebra.h"
#include "rig/strict_toml.h"

namespace plumbline::app {
namespace {

int code(ExitCode exit_code) { return static_cast<int>(exit_code); }

/// Every failure is exactly one line.
void complain(std::string message) {
  while (!message.empty() && message.back() == '\n') message.pop_back();
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::cout.flush();
  std::fprintf(stderr, "plumbline: %s\n", message.c_str());
}

std::string usage_error(const CLI::App& program, const CLI::ParseError& error, int argc,
                        char** argv) {
  const std::vector<CLI::App*> parsed = program.get_subcommands();
  if (!parsed.empty()) {
    return fmt::format("{}; see plumbline {} --help", error.what(), parsed.front()->get_name());
  }
  if (argc < 2) return "no command given; see plumbline --help";
  if (argv[1][0] == '-') return fmt::format("{}; see plumbline --help", error.what());
  std::vector<std::string> known;
  for (const CLI::App* command : program.get_subcommands({})) known.push_back(command->get_name());
  const std::string hint = rig::nearest(argv[1], known);
  return fmt::format("there is no command {}; {}", argv[1],
                     hint.empty() ? "see plumbline --help" : fmt::format("did you mean {}?", hint));
}

int run(int argc, char** argv) {
  CLI::App program("Calibrates an accelerometer triad on a motorised two-axis dividing head.",
                   "plumbline");
  program.set_version_flag("--version", "plumbline " + program_version());
  program.require_subcommand(1);
  program.footer(
      "Exit codes: 0 done, and within the limits if limits were given; 1 done, and limits "
      "exceeded; "
      "2 wrong arguments, configuration, input or output; 3 rig or bus fault, stopped safely and "
      "resumable; 4 internal error.");

  Invocation invocation;
  add_calibrate(program, invocation);
  add_correct(program, invocation);
  add_evaluate(program, invocation);
  add_noise(program, invocation);
  add_run(program, invocation);
  add_dry_run(program, invocation);
  add_plan(program, invocation);
  add_runs(program, invocation);
  add_export(program, invocation);
  add_ctl(program, invocation);
  add_jobs(program, invocation);
  add_doctor(program, invocation);
  add_serve(program, invocation);
  add_verify(program, invocation);
  add_help(program, invocation);

  try {
    program.parse(argc, argv);
  } catch (const CLI::Success& request) {
    return program.exit(request);  // --help, --version
  } catch (const CLI::ParseError& error) {
    complain(usage_error(program, error, argc, argv));
    return code(ExitCode::wrong_use);
  }
  const Result<ExitCode> outcome = invocation.action();
  if (outcome) {
    // A reader that has seen enough (`| head`) is no failure; a full disk is one.
    errno = 0;
    if (!std::cout.flush() && errno != EPIPE) {
      complain(
          fmt::format("standard output: cannot write: {}", std::generic_category().message(errno)));
      return code(ExitCode::wrong_use);
    }
    return code(*outcome);
  }
  complain(outcome.error().message);
  return code(exit_code_of(outcome.error().code));
}

}  // namespace
}  // namespace plumbline::app

int main(int argc, char** argv) {
  plumbline::start_with_kernels_for_processor(argv);
  // A full disk and a closed pipe are failures of a write, reported there, not a sudden death.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  try {
    return plumbline::app::run(argc, argv);
  } catch (const std::exception& error) {
    plumbline::app::complain(fmt::format("internal error: {}", error.what()));
  } catch (...) {
    plumbline::app::complain("internal error");
  }
  return plumbline::app::code(plumbline::app::ExitCode::internal_error);
}
