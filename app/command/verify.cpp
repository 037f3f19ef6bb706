// `plumbline verify`: has a certificate been changed, and do its forms say the same?
#include <fmt/format.h>

#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

#include "app/command/command.h"
#include "app/verify/verify.h"

namespace plumbline::app {

namespace {

struct VerifyArguments {
  std::string target;
  std::string schema;
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

Result<ExitCode> verify(const VerifyArguments& arguments) {
  const auto report = verify_certificate(arguments.target, schema_of(arguments));
  if (!report) return fail(report.error());
  return print(*report, arguments.target);
}

}  // namespace

void add_verify(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand(
      "verify", "check that a certificate is unchanged and its forms say the same");
  auto arguments = std::make_shared<VerifyArguments>();
  sub->add_option("certificate", arguments->target,
                  "output folder, certificate.xml or certificate.pdf")
      ->required();
  sub->add_option("--schema", arguments->schema,
                  "folder that holds v3.3.0/dcc.xsd of the DCC (or PLUMBLINE_DCC_SCHEMA in the "
                  "environment); without it the schema is not checked");
  sub->footer(
      "Exit codes: 0 everything that was checked holds; 1 something does not; 2 wrong use, or a "
      "file cannot be read.");
  sub->callback(
      [arguments, &invocation] { invocation.action = [arguments] { return verify(*arguments); }; });
}

}  // namespace plumbline::app
