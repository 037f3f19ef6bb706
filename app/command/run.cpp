// `plumbline run`: a calibration on a real rig.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "app/command/certificate_options.h"
#include "app/command/command.h"
#include "app/command/measure.h"
#include "app/command/station_options.h"
#include "app/config/rig_description.h"
#include "app/io/output_folder.h"
#include "app/sequencer/separation_plan.h"

namespace plumbline::app {

namespace {

struct RunArguments {
  std::string config;
  std::string serial;
  std::string database;
  std::string out;
  bool resume = false;
  CertificateOptions certificate;
  NotifyOptions notify;
  bool no_journal = false;
  std::string operator_name;
  ServeOptions serve;
  std::string plan;
  std::string effects;
  bool separate = false;
};

Result<ExitCode> run(const RunArguments& arguments) {
  auto rig = read_rig_description(arguments.config);
  if (!rig) return fail(rig.error());
  const auto style = certificate_style(arguments.certificate);
  if (!style) return fail(style.error());
  if (!arguments.serial.empty()) rig->run.dut.serial = arguments.serial;
  std::optional<Plan> plan;
  if (!arguments.plan.empty()) {
    auto read = read_plan_file(arguments.plan);
    if (!read) return fail(read.error());
    plan = *std::move(read);
  }
  // An unwritable place is refused before the hours of measuring, not after them.
  if (auto folder = OutputFolder::prepare(arguments.out); !folder) return fail(folder.error());
  const std::string hint =
      fmt::format("plumbline run --resume --config {} --serial {} --db {} --out {}{}{}{}",
                  arguments.config, rig->run.dut.serial, arguments.database, arguments.out,
                  arguments.plan.empty() ? "" : " --plan " + arguments.plan,
                  arguments.effects.empty() ? "" : " --effects " + arguments.effects,
                  arguments.separate ? " --separate" : "");
  NotifyOptions notify = arguments.notify;
  if (notify.journal.empty() && !arguments.no_journal) notify.journal = arguments.database + ".log";
  const auto station = station_of_run(arguments.serve, arguments.database, arguments.out);
  if (!station) return fail(station.error());
  auto code = measure_and_calibrate({.session = {.rig = *rig,
                                                 .database = arguments.database,
                                                 .out = arguments.out,
                                                 .resume = arguments.resume,
                                                 .operator_name = arguments.operator_name,
                                                 .plan = plan},
                                     .out = arguments.out,
                                     .style = *style,
                                     .notify = notify,
                                     .separate = arguments.separate,
                                     .effects = arguments.effects,
                                     .resume_hint = hint});
  if (*station) (*station)->let_viewers_see_the_end();
  return code;
}

}  // namespace

void add_run(CLI::App& program, Invocation& invocation) {
  CLI::App* sub =
      program.add_subcommand("run", "measure a unit on the rig, calibrate and certify it");
  auto arguments = std::make_shared<RunArguments>();
  sub->add_option("--config", arguments->config, "rig.toml")->required();
  sub->add_option("--serial", arguments->serial, "of the unit, instead of the one in rig.toml")
      ->required();
  sub->add_option("--db", arguments->database, "run database, made when absent")->required();
  sub->add_option("--out", arguments->out, "folder for results and certificate")->required();
  sub->add_flag("--resume", arguments->resume, "go on with the unit's last unfinished run");
  sub->add_option("--operator", arguments->operator_name, "who measures; noted with the run");
  sub->add_option("--plan", arguments->plan,
                  "steps to run instead of [grid] and [plan], as `plan --csv` and a calibration's "
                  "separate.csv have them");
  sub->add_flag("--separate", arguments->separate,
                "measure at once, in the same run, the poses that tell effects apart where they "
                "leave more than one explanation, and decide again");
  sub->add_option("--effects", arguments->effects,
                  "effects of your own, searched for like the listed ones (TOML)");
  add_certificate_options(*sub, arguments->certificate);
  add_serve_options(*sub, arguments->serve);
  sub->add_option("--summary", arguments->notify.summary, "how it ended, as JSON, into this file");
  sub->add_option("--hook", arguments->notify.hook,
                  "shell command for every alarm and at the end; PLUMBLINE_EVENT and others say "
                  "what happened");
  sub->add_option("--journal", arguments->notify.journal,
                  "every event as a line; rotated (default: DATABASE.log)");
  sub->add_flag("--no-journal", arguments->no_journal, "keep no journal");
  sub->callback(
      [arguments, &invocation] { invocation.action = [arguments] { return run(*arguments); }; });
}

}  // namespace plumbline::app
