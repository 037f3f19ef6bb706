// `plumbline ctl`: orders to a session that is running, and a look at it.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>

#include "app/command/command.h"
#include "app/io/json.h"
#include "app/sequencer/control_socket.h"

namespace plumbline::app {

namespace {

constexpr double kWatchTimeout_s = 30;

struct CtlArguments {
  std::string database;
  std::string socket;
  std::string at = "now";
  bool json = false;
  bool wait = false;
};

std::string duration(const Json& seconds) {
  if (!seconds.is_number()) return "?";
  const auto whole = std::lround(seconds.get<double>());
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string status_text(const Json& status) {
  const Json& head = status["head"];
  const Json& attention = status["attention"];
  std::string text = fmt::format(
      "{}: {}\n"
      "run {} of {} in {}: {} of {} steps done, {:.0f} %, {} to go\n"
      "head at δ {:.4f}° h {:.4f}°, going for δ {:.2f}° h {:.2f}°{}\n"
      "retries {}, recoveries {}, suspensions {}, put off {}, left out {}\n",
      status["state"].get<std::string>(), status["reason"].get<std::string>(), status["run"].dump(),
      status["serial"].get<std::string>(), status["database"].get<std::string>(),
      status["done"].dump(), status["steps"].dump(), 100 * status["progress"].get<double>(),
      duration(status["remaining_s"]), head["delta_deg"].get<double>(), head["h_deg"].get<double>(),
      status["target"]["delta_deg"].get<double>(), status["target"]["h_deg"].get<double>(),
      // The drive says so of a head at rest only.
      head["homed"].get<bool>() || head["moving"].get<bool>() ? "" : ", not homed",
      attention["retries"].dump(), attention["recoveries"].dump(), attention["suspensions"].dump(),
      attention["skipped"].dump(), attention["left_out"].dump());
  for (const Json& event : status["events"]) {
    if (event["kind"] == "state") continue;
    text += fmt::format("  {} {}: {}\n", event["utc"].get<std::string>(),
                        event["kind"].get<std::string>(), event["text"].get<std::string>());
  }
  return text;
}

Result<ControlClient> connect(const CtlArguments& arguments) {
  if (arguments.socket.empty() && arguments.database.empty()) {
    const auto sessions = running_sessions();
    if (sessions.empty()) return fail(ErrorCode::input, "no session is running");
    if (sessions.size() > 1) {
      return fail(ErrorCode::input,
                  fmt::format("{} sessions are running; give --db to say which", sessions.size()));
    }
    return ControlClient::connect(sessions.front());
  }
  return ControlClient::connect(arguments.socket.empty() ? control_path(arguments.database)
                                                         : std::filesystem::path(arguments.socket));
}

Result<Json> accepted(Result<Json> reply) {
  if (!reply) return reply;
  if (!reply->is_object() || !reply->value("ok", false)) {
    return fail(ErrorCode::rig, fmt::format("refused by the session: {}",
                                            reply->value("error", "no reason given")));
  }
  return reply;
}

Result<ExitCode> order(const CtlArguments& arguments, const Json& request) {
  auto client = connect(arguments);
  if (!client) return fail(client.error());
  auto reply = accepted(client->ask(request));
  if (!reply) return fail(reply.error());
  if (arguments.wait) {  // until the session has ended
    if (auto watching = client->ask({{"command", "watch"}, {"interval_ms", 1000}}); !watching) {
      return ExitCode::done;
    }
    while (client->receive(kWatchTimeout_s)) {
    }
  }
  return ExitCode::done;
}

Result<ExitCode> show(const CtlArguments& arguments) {
  auto client = connect(arguments);
  if (!client) return fail(client.error());
  const auto reply = accepted(client->ask({{"command", "status"}}));
  if (!reply) return fail(reply.error());
  std::cout << (arguments.json ? file_text((*reply)["status"]) : status_text((*reply)["status"]));
  return ExitCode::done;
}

/// One line of JSON for each change until the session ends.
Result<ExitCode> watch(const CtlArguments& arguments) {
  auto client = connect(arguments);
  if (!client) return fail(client.error());
  const auto reply = accepted(client->ask({{"command", "watch"}, {"interval_ms", 1000}}));
  if (!reply) return fail(reply.error());
  while (auto line = client->receive(kWatchTimeout_s)) {
    std::cout << (*line)["status"].dump() << "\n" << std::flush;
    if (!std::cout) break;
  }
  return ExitCode::done;
}

}  // namespace

void add_ctl(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand("ctl", "pause, resume, stop or look at a running session");
  sub->require_subcommand(1);
  auto arguments = std::make_shared<CtlArguments>();
  sub->add_option("--db", arguments->database,
                  "run database of the session; may be left out when only one is running");
  sub->add_option("--socket", arguments->socket, "its control socket, when it is not DATABASE.ctl");
  sub->fallthrough();

  const auto add = [&](const char* name, const char* text, auto action) {
    CLI::App* command = sub->add_subcommand(name, text);
    command->callback([arguments, action, &invocation] {
      invocation.action = [arguments, action] { return action(*arguments); };
    });
    return command;
  };
  CLI::App* pause = add("pause", "stop the motors and wait", [](const CtlArguments& given) {
    return order(given, {{"command", "pause"}, {"at", given.at}});
  });
  pause->add_option("--at", arguments->at, "now, or once the present pose is committed")
      ->check(CLI::IsMember({"now", "pose"}))
      ->capture_default_str();
  add("resume", "go on after a pause", [](const CtlArguments& given) {
    return order(given, {{"command", "resume"}});
  });
  CLI::App* stop = add("stop", "stop the motors and end the run; it can be resumed",
                       [](const CtlArguments& given) {
                         return order(given, {{"command", "stop"}});
                       });
  stop->add_flag("--wait", arguments->wait, "return when the session has ended");
  add("abort", "the same without waiting for a silent drive", [](const CtlArguments& given) {
    return order(given, {{"command", "abort"}});
  });
  add("status", "what the session is doing", show)
      ->add_flag("--json", arguments->json, "everything, as JSON");
  add("watch", "a line of JSON for every change, until the session ends", watch);
}

}  // namespace plumbline::app
