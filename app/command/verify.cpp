// `plumbline verify`: has anything been changed since it was recorded or certified?
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

#include "app/command/command.h"
#include "app/verify/verify.h"
#include "storage/run_store.h"

namespace plumbline::app {

namespace {

struct VerifyArguments {
  std::string target;
  std::string schema;
  std::string signer;
  std::string database;
  std::optional<storage::RunId> run;
  std::string head;
};

std::optional<std::filesystem::path> schema_of(const VerifyArguments& arguments) {
  if (!arguments.schema.empty()) return arguments.schema;
  const char* folder = std::getenv("PLUMBLINE_DCC_SCHEMA");
  if (folder != nullptr && *folder != '\0') return folder;
  return std::nullopt;
}

/// One line a check; the last line says what came out.
ExitCode print(const VerifyReport& report, const std::string& what) {
  std::size_t bad = 0;
  for (const Check& check : report.checks) {
    bad += check.state == CheckState::bad ? 1 : 0;
    fmt::print("{} {}\n",
               check.state == CheckState::good  ? "ok    "
               : check.state == CheckState::bad ? "FAILED"
                                                : "-     ",
               check.text);
  }
  if (bad == 0) {
    fmt::print("{}: unchanged and consistent.\n", what);
    return ExitCode::done;
  }
  fmt::print("{}: {} of {} checks FAILED.\n", what, bad, report.checks.size());
  return ExitCode::limits_exceeded;
}

/// One line for each run, one for each fault; true when there is none.
bool print_report(const storage::ChainReport& report, const std::string& head) {
  bool sound = report.faults.empty();
  fmt::print("run {}: {} poses, hash chain {}, head {}\n", report.run, report.poses,
             sound ? "unbroken" : "BROKEN", report.head);
  for (const std::string& fault : report.faults) fmt::print("  {}\n", fault);
  if (!head.empty() && head != report.head) {
    fmt::print("  the head is not {}: this is not the run of that certificate, or it was changed\n",
               head);
    sound = false;
  }
  return sound;
}

Result<ExitCode> verify_database(const VerifyArguments& arguments) {
  const auto store = storage::RunStore::open_read_only(arguments.database);
  if (!store) return fail(store.error());
  const auto runs = store->runs();
  if (!runs) return fail(runs.error());
  if (arguments.run && std::none_of(runs->begin(), runs->end(),
                                    [&](const auto& run) { return run.id == *arguments.run; })) {
    return fail(ErrorCode::input, fmt::format("{}: there is no run {}; `plumbline runs` lists them",
                                              arguments.database, *arguments.run));
  }
  bool sound = true;
  for (const storage::RunSummary& run : *runs) {
    if (arguments.run && run.id != *arguments.run) continue;
    const auto report = store->check_chain(run.id);
    if (!report) return fail(report.error());
    sound = print_report(*report, arguments.head) && sound;
  }
  const auto removed = store->removed_runs();
  if (!removed) return fail(removed.error());
  for (const storage::RunId run : *removed) {
    fmt::print("run {}: was removed\n", run);
    sound = false;
  }
  return sound ? ExitCode::done : ExitCode::limits_exceeded;
}

Result<ExitCode> verify(const VerifyArguments& arguments) {
  if (!arguments.database.empty()) return verify_database(arguments);
  if (arguments.target.empty())
    return fail(ErrorCode::input, "verify needs a certificate or --db FILE");
  const auto report = verify_certificate(
      arguments.target, schema_of(arguments),
      arguments.signer.empty() ? std::nullopt
                               : std::optional<std::filesystem::path>(arguments.signer));
  if (!report) return fail(report.error());
  return print(*report, arguments.target);
}

}  // namespace

void add_verify(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand(
      "verify", "check that a certificate or the data of a run are unchanged");
  auto arguments = std::make_shared<VerifyArguments>();
  CLI::Option* target = sub->add_option("certificate", arguments->target,
                                        "output folder, certificate.xml or certificate.pdf");
  sub->add_option("--schema", arguments->schema,
                  "folder that holds v3.3.0/dcc.xsd of the DCC (or PLUMBLINE_DCC_SCHEMA in the "
                  "environment); without it the schema is not checked");
  sub->add_option("--signer", arguments->signer,
                  "certificates (PEM): the XML must be signed by one of them, or by a key that one "
                  "of them vouches for")
      ->needs(target);
  CLI::Option* database = sub->add_option("--db", arguments->database,
                                          "run database: every pose against its hash chain")
                              ->excludes(target);
  CLI::Option* run = sub->add_option("--run", arguments->run, "only this run")->needs(database);
  sub->add_option("--head", arguments->head,
                  "head of the chain as it stands on the certificate (64 hexadecimal digits)")
      ->needs(run);
  sub->footer(
      "Exit codes: 0 everything that was checked holds; 1 something does not; 2 wrong use, or a "
      "file cannot be read.");
  sub->callback(
      [arguments, &invocation] { invocation.action = [arguments] { return verify(*arguments); }; });
}

}  // namespace plumbline::app
