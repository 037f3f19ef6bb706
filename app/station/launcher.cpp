#include "app/station/launcher.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstring>

#include "app/io/read_file.h"
#include "app/provenance.h"
#include "app/station/http.h"

extern char** environ;

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kLongestSerial = 64;
constexpr std::size_t kLongestName = 80;

bool has_control_character(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

Result<std::string> text_field(const Json& json, const char* key, std::size_t longest) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_string()) {
    return fail(ErrorCode::input, fmt::format("{} is missing", key));
  }
  std::string text = trimmed(found->get<std::string>());
  if (text.size() > longest || has_control_character(text)) {
    return fail(ErrorCode::input, fmt::format("{} has more than {} characters, or some that cannot "
                                              "be printed",
                                              key, longest));
  }
  return text;
}

/// What a folder may be called.
std::string file_name(const std::string& serial) {
  std::string name;
  for (const char c : serial) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' ||
                       (c == '.' && !name.empty());
    name += plain ? c : '_';
  }
  return name;
}

std::string last_line(const fs::path& file) {
  const auto text = read_file(file);
  if (!text) return "";
  const std::size_t end = text->find_last_not_of("\r\n");
  if (end == std::string::npos) return "";
  const std::size_t begin = text->find_last_of("\r\n", end);
  return text->substr(begin == std::string::npos ? 0 : begin + 1, end - begin);
}

}  // namespace

Result<StartOrder> start_order(const Json& json) {
  if (!json.is_object()) return fail(ErrorCode::input, "an order is an object");
  auto serial = text_field(json, "serial", kLongestSerial);
  if (!serial) return fail(serial.error());
  if (serial->empty()) return fail(ErrorCode::input, "the serial number is missing");
  auto name = text_field(json, "operator", kLongestName);
  if (!name) return fail(name.error());
  if (name->empty()) return fail(ErrorCode::input, "the operator is missing");
  auto plan = text_field(json, "plan", kLongestName);
  if (!plan) return fail(plan.error());
  const Json resume = json.value("resume", Json(false));
  if (!resume.is_boolean()) return fail(ErrorCode::input, "resume is true or false");
  return StartOrder{*std::move(serial), *std::move(name), *std::move(plan), resume.get<bool>()};
}

Launcher::Launcher(LauncherOptions options) : options_(std::move(options)) {}

Result<std::vector<std::string>> Launcher::words(const StartOrder& order,
                                                 const fs::path& folder) const {
  const auto plan = std::find_if(options_.plans.begin(), options_.plans.end(),
                                 [&](const StationPlan& one) { return one.name == order.plan; });
  if (plan == options_.plans.end()) {
    return fail(ErrorCode::input, fmt::format("there is no plan {}", order.plan));
  }
  if (plan->simulated && order.resume) {
    return fail(ErrorCode::input, "a dry run cannot be resumed; start a new one");
  }
  // Every value in one word with its option: a serial number that begins with a dash is no option.
  std::vector<std::string> words = {"plumbline",
                                    plan->simulated ? "dry-run" : "run",
                                    "--serial=" + order.serial,
                                    "--operator=" + order.operator_name,
                                    "--db=" + options_.database.string(),
                                    "--out=" + folder.string(),
                                    "--language=" + options_.language};
  if (!plan->config.empty()) words.push_back("--config=" + plan->config.string());
  if (plan->simulated) words.push_back(fmt::format("--speed={}", plan->speed));
  if (!options_.laboratory.empty()) words.push_back("--lab=" + options_.laboratory);
  if (order.resume) words.emplace_back("--resume");
  return words;
}

Result<void> Launcher::start(const StartOrder& order) {
  const std::lock_guard lock(mutex_);
  look();
  if (child_ > 0) return fail(ErrorCode::input, "a run is under way already");
  std::string time = utc_now();
  std::erase_if(time, [](char c) { return c == ':' || c == '-'; });
  const fs::path folder = options_.results / fmt::format("{}-{}", file_name(order.serial), time);
  auto arguments = words(order, folder);
  if (!arguments) return fail(arguments.error());
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return fail(ErrorCode::output,
                fmt::format("{}: cannot be made a folder ({})", folder.string(), error.message()));
  }
  log_ = folder / "run.log";
  std::vector<char*> argv;
  for (std::string& word : *arguments) argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, 1, log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&files, 1, 2);
  posix_spawn_file_actions_addclosefrom_np(&files, 3);  // our connections are not the child's
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  // Ctrl-C here must not stop the motors there.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  const int failed =
      ::posix_spawn(&child_, "/proc/self/exe", &files, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (failed != 0) {
    child_ = -1;
    return fail(ErrorCode::output,
                fmt::format("the run cannot be started ({})", std::strerror(failed)));
  }
  serial_ = order.serial;
  exit_code_.reset();
  return {};
}

void Launcher::look() {
  if (child_ <= 0) return;
  int status = 0;
  if (::waitpid(child_, &status, WNOHANG) != child_) return;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  child_ = -1;
}

Json Launcher::last_json() {
  const std::lock_guard lock(mutex_);
  look();
  if (child_ <= 0 && !exit_code_) return {};
  const bool failed = exit_code_ && *exit_code_ > 1;
  return {{"running", child_ > 0},
          {"serial", serial_},
          {"exit_code", exit_code_ ? Json(*exit_code_) : Json()},
          {"message", failed ? last_line(log_) : ""}};
}

}  // namespace plumbline::app
