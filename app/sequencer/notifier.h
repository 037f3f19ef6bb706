// Tells the outside how a session is going: a journal that rotates, the service manager, a hook
// command, and a summary at the end.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "app/exit_code.h"
#include "app/io/json.h"
#include "app/sequencer/engine_report.h"
#include "app/sequencer/live_state.h"

namespace spdlog {
class logger;
}

namespace plumbline::app {

struct NotifyOptions {
  std::filesystem::path journal;  ///< empty: none; rotated at 2 MB, four older ones are kept
  std::filesystem::path summary;  ///< empty: none
  /// Shell command, run beside the session with PLUMBLINE_EVENT = alarm | end, PLUMBLINE_STATE,
  /// PLUMBLINE_REASON, PLUMBLINE_SERIAL, PLUMBLINE_DATABASE and, at the end, PLUMBLINE_EXIT_CODE
  /// and PLUMBLINE_SUMMARY in its environment; empty: none. Alarm: the engine recovers from a fault
  /// or is suspended; at most one alarm a minute.
  std::string hook;
};

/// How a session ended, as one object (schema "plumbline.exit/1").
struct ExitSummary {
  ExitCode exit_code = ExitCode::done;
  std::string message;     ///< the sentence that was printed
  std::string resume;      ///< command that goes on; empty when there is nothing to go on with
  std::string chain_head;  ///< of the run's hash chain; empty when no run was begun
};
Json exit_json(const LiveSnapshot& snapshot, const ExitSummary& summary);

/// For what takes long outside of a session: tells the service manager that we live.
void tell_service_manager(const std::string& status);

/// No failure in here ends a session: measuring is what matters.
class Notifier {
 public:
  Notifier(NotifyOptions options, const LiveState& live);
  /// Waits for the hook command, a minute at most.
  ~Notifier();
  Notifier(const Notifier&) = delete;
  Notifier& operator=(const Notifier&) = delete;

  /// On the engine's thread, at every turn: the service manager's watchdog is fed from here, so it
  /// sees the sequencer's own progress and not that of some idle thread.
  void update(const Progress& progress);
  /// What follows the measuring takes its time without an engine that turns.
  void calibrating();
  void end(const ExitSummary& summary);

 private:
  using Clock = std::chrono::steady_clock;
  void log(const Progress& progress);
  void run_hook(const std::string& event, const Progress& progress, const std::string& exit_code);

  NotifyOptions options_;
  const LiveState& live_;
  std::shared_ptr<spdlog::logger> journal_;
  std::uint64_t events_ = 0;
  EngineState state_ = EngineState::idle;
  bool ready_ = false;
  Clock::duration feed_interval_{};
  Clock::time_point next_feed_;
  Clock::time_point next_alarm_;
  pid_t hook_process_ = -1;
};

}  // namespace plumbline::app
