// What is going on at the rig, for any number of viewers. Follows the control socket of whatever
// session runs on the database, in this process or another one, and outlives it.
//
// MESSAGE, one JSON object:
//   schema "plumbline.live/1", version (counts messages), phase, status, run, trace, estimate,
//   noise, poses, poses_version, verdict, last_end
//   phase: "running"      a session is on; `status` is its STATUS (app/sequencer/control_socket.h)
//                         without `samples` and `events`
//          "calculating"  measured; the result is not there yet
//          "finished"     the last run is done; `verdict` says what came out, if it was calibrated
//          "stopped" | "failed" | "interrupted"   the last run can be resumed; interrupted: its
//                         program died
//          "empty"        no run so far
//   run: {id, serial, started_utc, finished_utc, delta_deg: [start, stop, step], h_deg: likewise}
//   trace: [[t_s, x_V, y_V, z_V, temp_C]…] since the message before
//   estimate: {x: {value: [K, K, K, U0], u: […], rms_mps2}, …} or null; noise: {sd_V, sd_mps2}
//   poses, poses_version: how many rows poses() has; another version means: ask for all of them
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "app/sequencer/engine_report.h"
#include "app/station/history.h"

namespace plumbline::app {

class ControlClient;

struct LiveMessage {
  std::uint64_t version = 0;
  std::string text;  ///< MESSAGE on one line
};

/// Stored and told events are the same one when time and text are.
struct LiveEvent {
  long long t_ms = 0;
  std::string text;
  Json json;
};

class LiveFeed {
 public:
  /// `history` must live longer.
  explicit LiveFeed(const History& history);
  ~LiveFeed();
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  std::shared_ptr<const LiveMessage> newest() const;
  /// The newest message once it is not `version`; nothing when that takes too long.
  std::shared_ptr<const LiveMessage> wait(std::uint64_t version,
                                          std::chrono::milliseconds longest) const;
  /// The traces so far, for a viewer who comes in the middle: {"trace": […]}.
  std::string trace() const;
  /// {"poses_version": …, "poses": [[step, delta, h, rx, ry, rz, settle_s, temp_C]…]} with the
  /// running residuals in m/s², null while there is no estimate; verification poses left out.
  std::string poses() const;
  /// Of this run, oldest first: {"events": [{t_s, utc, kind, text}…]}; without going from pose to
  /// pose.
  std::string events() const;
  /// The newest STATUS; null when no session is on.
  Json status() const;
  bool session_running() const;
  /// Looks once more at what is there, and waits until nothing goes on: neither a session, nor the
  /// calculation of what it measured.
  void catch_up(std::chrono::milliseconds longest);

 private:
  void follow(const std::stop_token& stop);
  void follow_session(ControlClient& client, const std::stop_token& stop);
  void begin_run(const Json& status);
  void take(Json status);
  void take_poses(ControlClient& client, std::size_t total);
  void look_at_database();
  void read_plan(const std::string& config_toml);
  void read_stored(storage::RunId run);
  /// Under the mutex.
  void add_event(double t_s, const std::string& kind, const std::string& text, Json json);
  void refit();
  void publish(Json message);

  const History& history_;
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  std::shared_ptr<const LiveMessage> newest_ = std::make_shared<LiveMessage>();

  // Under the mutex, because viewers ask for them.
  std::deque<std::string> trace_;  ///< rows, as text
  std::string poses_text_;
  std::vector<LiveEvent> events_;  ///< in the order in which they happened
  Json status_;
  bool running_ = false;
  std::string phase_;
  std::uint64_t looks_wanted_ = 0;
  std::uint64_t looks_done_ = 0;  ///< of those wanted

  // Of the thread alone.
  storage::RunId run_ = 0;
  std::string session_;  ///< tells sessions of one run apart
  Json run_json_;
  double gamma_ = 1;
  std::map<long long, PoseMean> means_;  ///< by step
  std::size_t taken_ = 0;                ///< pose means asked for in this session
  int suspects_ = 0;
  std::uint64_t poses_version_ = 0;
  double newest_sample_s_ = -1;
  Json estimate_;
  Json noise_;
  std::vector<std::string> fresh_trace_;
  std::uint64_t version_ = 0;

  std::jthread thread_;
};

}  // namespace plumbline::app
