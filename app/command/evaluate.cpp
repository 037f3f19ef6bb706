#include "app/command/command.h"

namespace plumbline::app {

void add_evaluate(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand("evaluate", "not yet");
  sub->callback([&invocation] {
    invocation.action = []() -> Result<ExitCode> { return fail(ErrorCode::input, "not yet"); };
  });
}

}  // namespace plumbline::app
