// The subcommands of `plumbline`: one file each in this folder, listed in main.cpp.
//
// Convention: `add_NAME(program, invocation)` declares the subcommand with its options and lets the
// parsed subcommand store what is to be done in `invocation.action`. Nothing is done while the
// command line is still being parsed.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "app/exit_code.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// What the command line asks for. A failed action is printed by main() as one line on stderr, and
/// its ErrorCode decides the exit code; actions print nothing on stderr themselves.
struct Invocation {
  std::function<Result<ExitCode>()> action;
};

void add_calibrate(CLI::App& program, Invocation& invocation);
void add_correct(CLI::App& program, Invocation& invocation);
void add_evaluate(CLI::App& program, Invocation& invocation);
void add_noise(CLI::App& program, Invocation& invocation);
void add_run(CLI::App& program, Invocation& invocation);
void add_dry_run(CLI::App& program, Invocation& invocation);
void add_plan(CLI::App& program, Invocation& invocation);
void add_runs(CLI::App& program, Invocation& invocation);
void add_export(CLI::App& program, Invocation& invocation);
void add_ctl(CLI::App& program, Invocation& invocation);
void add_jobs(CLI::App& program, Invocation& invocation);
void add_doctor(CLI::App& program, Invocation& invocation);
void add_serve(CLI::App& program, Invocation& invocation);
void add_verify(CLI::App& program, Invocation& invocation);
void add_help(CLI::App& program, Invocation& invocation);

}  // namespace plumbline::app
