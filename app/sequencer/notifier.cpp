#include "app/sequencer/notifier.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <sys/wait.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <thread>
#include <utility>
#include <vector>

#include "app/provenance.h"

namespace plumbline::app {

namespace {

using std::chrono::milliseconds;

constexpr std::size_t kJournalBytes = 2'000'000;
constexpr std::size_t kOlderJournals = 4;
constexpr std::chrono::minutes kAlarmInterval{1};
constexpr std::chrono::minutes kHookLimit{1};
/// The service manager waits so long for the calibration before it takes us for dead.
constexpr const char* kCalibrationPatience = "WATCHDOG_USEC=1800000000";

std::shared_ptr<spdlog::logger> open_journal(const std::filesystem::path& file) {
  if (file.empty()) return nullptr;
  try {
    auto sink = std::make_shared<spdlog::sinks::rotating_file_sink_st>(file.string(), kJournalBytes,
                                                                       kOlderJournals);
    auto logger = std::make_shared<spdlog::logger>("journal", std::move(sink));
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %v");
    logger->set_error_handler([](const std::string&) {});
    logger->flush_on(spdlog::level::info);
    return logger;
  } catch (const std::exception&) {
    return nullptr;  // a full disk: the database says so
  }
}

}  // namespace

Json exit_json(const LiveSnapshot& snapshot, const ExitSummary& summary) {
  const Progress& progress = snapshot.progress;
  const Attention& attention = progress.attention;
  return {{"schema", "plumbline.exit/1"},
          {"exit_code", static_cast<int>(summary.exit_code)},
          {"state", to_string(progress.state)},
          {"message", summary.message},
          {"resume", summary.resume.empty() ? Json() : Json(summary.resume)},
          {"run", progress.run > 0 ? Json(progress.run) : Json()},
          {"serial", snapshot.run.serial},
          {"database", snapshot.run.database},
          {"out", snapshot.run.out},
          {"chain_head", summary.chain_head.empty() ? Json() : Json(summary.chain_head)},
          {"started_utc", snapshot.run.started_utc},
          {"ended_utc", utc_now()},
          {"elapsed_s", json_number(snapshot.elapsed_s)},
          {"steps", progress.steps},
          {"done", progress.done},
          {"samples_received", progress.samples_received},
          {"attention",
           {{"retries", attention.retries},
            {"recoveries", attention.recoveries},
            {"suspensions", attention.suspensions},
            {"skipped", attention.skipped},
            {"left_out", attention.left_out},
            {"suspects", attention.suspects}}},
          {"program_version", program_version()}};
}

void tell_service_manager(const std::string& status) {
  sd_notifyf(0, "READY=1\nWATCHDOG=1\nSTATUS=%.200s", status.c_str());
}

Notifier::Notifier(NotifyOptions options, const LiveState& live)
    : options_(std::move(options)), live_(live), journal_(open_journal(options_.journal)) {
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) > 0) {
    feed_interval_ = std::chrono::microseconds(watchdog_us / 3);
    // A calibration before may have asked for more patience.
    sd_notifyf(0, "WATCHDOG_USEC=%llu", static_cast<unsigned long long>(watchdog_us));
  }
}

Notifier::~Notifier() {
  const auto limit = Clock::now() + kHookLimit;
  while (hook_process_ > 0 && ::waitpid(hook_process_, nullptr, WNOHANG) == 0) {
    if (Clock::now() > limit) {
      ::kill(-hook_process_, SIGKILL);
      ::waitpid(hook_process_, nullptr, 0);
      break;
    }
    std::this_thread::sleep_for(milliseconds{10});
  }
}

void Notifier::log(const Progress& progress) {
  if (progress.events == events_) return;
  events_ = progress.events;
  if (journal_ == nullptr) return;
  const storage::EventRecord& event = progress.last_event;
  journal_->info("run {} t={:.3f} {}: {}", progress.run, event.t_s, event.kind, event.text);
}

void Notifier::update(const Progress& progress) {
  log(progress);
  const Clock::time_point now = Clock::now();
  const bool changed = progress.state != state_;
  if (!ready_ || changed) {
    sd_notifyf(0, "READY=1\nSTATUS=%s, %zu of %zu steps: %.200s", to_string(progress.state),
               progress.done, progress.steps, progress.reason.c_str());
    ready_ = true;
  }
  if (feed_interval_ > Clock::duration{} && now >= next_feed_) {
    sd_notify(0, "WATCHDOG=1");
    next_feed_ = now + feed_interval_;
  }
  if (!changed) return;
  const bool suspended =
      progress.state == EngineState::paused && progress.reason != kPausedOnRequest;
  if ((progress.state == EngineState::recovering || suspended) && now >= next_alarm_) {
    next_alarm_ = now + kAlarmInterval;
    run_hook("alarm", progress, "");
  }
  state_ = progress.state;
}

void Notifier::calibrating() {
  if (feed_interval_ > Clock::duration{}) sd_notify(0, kCalibrationPatience);
  sd_notify(0, "STATUS=calibrating");
}

void Notifier::end(const ExitSummary& summary) {
  const LiveSnapshot snapshot = live_.snapshot();
  if (journal_ != nullptr) {
    journal_->info("run {} ended with {}: {}", snapshot.progress.run,
                   static_cast<int>(summary.exit_code), summary.message);
  }
  if (!options_.summary.empty()) {
    const std::filesystem::path half = options_.summary.string() + ".new";
    std::ofstream file(half, std::ios::binary);
    file << file_text(exit_json(snapshot, summary));
    file.close();
    std::error_code ignored;
    if (file) std::filesystem::rename(half, options_.summary, ignored);
  }
  sd_notifyf(0, "STOPPING=1\nSTATUS=ended with %d", static_cast<int>(summary.exit_code));
  run_hook("end", snapshot.progress, std::to_string(static_cast<int>(summary.exit_code)));
}

void Notifier::run_hook(const std::string& event, const Progress& progress,
                        const std::string& exit_code) {
  if (options_.hook.empty()) return;
  // One at a time: an alarm that is still being reported makes room for the end, not for an alarm.
  if (hook_process_ > 0 && ::waitpid(hook_process_, nullptr, WNOHANG) == 0) {
    if (event != "end") return;
    ::waitpid(hook_process_, nullptr, 0);
  }
  hook_process_ = -1;
  const LiveRun run = live_.snapshot().run;
  std::vector<std::string> settings;
  for (char** entry = environ; *entry != nullptr; ++entry) settings.emplace_back(*entry);
  for (const auto& [name, value] : std::initializer_list<std::pair<const char*, std::string>>{
           {"EVENT", event},
           {"STATE", to_string(progress.state)},
           {"REASON", progress.reason},
           {"SERIAL", run.serial},
           {"DATABASE", run.database},
           {"EXIT_CODE", exit_code},
           {"SUMMARY", event == "end" ? options_.summary.string() : ""}}) {
    settings.push_back(fmt::format("PLUMBLINE_{}={}", name, value));
  }
  std::vector<char*> environment;
  for (std::string& setting : settings) environment.push_back(setting.data());
  environment.push_back(nullptr);
  std::array<std::string, 3> words = {"/bin/sh", "-c", options_.hook};
  std::array<char*, 4> arguments = {words[0].data(), words[1].data(), words[2].data(), nullptr};

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  if (posix_spawn(&hook_process_, words[0].c_str(), &files, &attributes, arguments.data(),
                  environment.data()) != 0) {
    hook_process_ = -1;
  }
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
}

}  // namespace plumbline::app
