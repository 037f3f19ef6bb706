#include <fmt/format.h>

#include <iostream>
#include <memory>

#include "app/command/command.h"
#include "rig/strict_toml.h"

namespace plumbline::app {

namespace {

Result<ExitCode> print_help(const CLI::App& program, const std::string& command) {
  std::vector<std::string> names;
  for (const CLI::App* sub : program.get_subcommands({})) {
    names.push_back(sub->get_name());
    if (sub->get_name() == command) {
      std::cout << sub->help("plumbline");
      return ExitCode::done;
    }
  }
  if (command.empty()) {
    std::cout << program.help();
    return ExitCode::done;
  }
  const std::string hint = rig::nearest(command, names);
  return fail(ErrorCode::input,
              fmt::format("there is no command {}{}", command,
                          hint.empty() ? "" : fmt::format("; did you mean {}?", hint)));
}

}  // namespace

void add_help(CLI::App& program, Invocation& invocation) {
  auto command = std::make_shared<std::string>();
  CLI::App* sub = program.add_subcommand("help", "Explain the program or one command");
  sub->add_option("command", *command, "The command to explain");
  sub->callback([&program, &invocation, command] {
    invocation.action = [&program, command] { return print_help(program, *command); };
  });
}

}  // namespace plumbline::app
