// The local control socket of a running engine: `plumbline ctl`, a station page or any other
// program asks for its state and gives it orders.
//
// A Unix stream socket, mode 0600, by default DATABASE.ctl beside the run database; it exists as
// long as the session does. One JSON object a line, UTF-8, both ways; a request has at most 4096
// bytes. Each request is answered by one line, in order:
//
//   {"command": "status"}                      {"ok": true, "status": STATUS}
//   {"command": "pause", "at": "now"|"pose"}   {"ok": true}           "at" may be left out: "now"
//   {"command": "resume"}                      {"ok": true}
//   {"command": "stop"}                        {"ok": true}
//   {"command": "abort"}                       {"ok": true}
//   {"command": "poses", "first": N}           {"ok": true, "first": N, "total": M, "poses":
//   [POSE…]}
//   {"command": "watch", "interval_ms": 250}   {"ok": true}, and from then on {"status": STATUS}
//       lines: at once after a change of state, an event or a committed pose, else every
//       interval_ms (100 … 10000) as a sign of life; until the client leaves or the session ends
//   anything else                              {"ok": false, "error": "…"}
//
// An order is accepted, not yet carried out, when its answer comes: the state says when.
//
// STATUS (schema "plumbline.status/1"; what is not known is null):
//   pid, program_version, run, serial, database, out, started_utc
//   state: idle homing moving settling sampling paused recovering stopping finished stopped failed
//   reason (text), state_since_s, pause_requested: "none" | "pose" | "now"
//   step (0 …), steps, done, kind: soak grid verification
//   target: {delta_deg, h_deg}, head: {delta_deg, h_deg, in_position, moving, homed,
//           alarm: [δ, h], drive_temp_C: [δ, h]}
//   t_s (the run's clock), elapsed_s, remaining_s (host clock), progress (0 … 1)
//   samples_received, rate_hz
//   attention: {retries, recoveries, suspensions, skipped, left_out, suspects}
//   newest: SAMPLE, samples: [SAMPLE…] (the newest, oldest first), with
//           SAMPLE = {t_s, u_V: [x, y, z], temp_C}
//   last_pose: POSE, poses: how many POSEs can be asked for, with
//           POSE = {step, kind, delta_deg, h_deg, t_s, settle_s, samples, mean_V: [x, y, z],
//                   sd_V: [x, y, z], temp_C}
//   events: [{t_s, utc, kind, text}…] (the newest, oldest first)
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "app/io/json.h"
#include "app/sequencer/control.h"
#include "app/sequencer/live_state.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// DATABASE.ctl
std::filesystem::path control_path(const std::filesystem::path& database);

/// Control sockets of this machine's sessions that this user may talk to (those at short paths).
std::vector<std::filesystem::path> running_sessions();

Json pose_json(const PoseMean& pose);
Json status_json(const LiveSnapshot& snapshot, const EngineControl& control);

/// Serves on a thread of its own until destroyed; at most 32 clients. `state` and `control` must
/// live longer.
class ControlSocket {
 public:
  /// Takes over the socket of a session that died. ErrorCode::input when another session serves
  /// there (two programs must not drive one rig), ErrorCode::output when it cannot be made.
  static Result<std::unique_ptr<ControlSocket>> open(const std::filesystem::path& path,
                                                     const LiveState& state,
                                                     EngineControl& control);
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  struct Server;
  ControlSocket(std::filesystem::path path, std::unique_ptr<Server> server);

  std::filesystem::path path_;
  std::unique_ptr<Server> server_;
};

/// The other end, for one request at a time.
class ControlClient {
 public:
  /// ErrorCode::input when nobody serves there.
  static Result<ControlClient> connect(const std::filesystem::path& path);
  ControlClient(ControlClient&& other) noexcept;
  ControlClient& operator=(ControlClient&&) = delete;
  ~ControlClient();

  Result<void> send(const Json& request);
  /// The next line; ErrorCode::rig when the session has ended or is silent for `timeout_s`.
  Result<Json> receive(double timeout_s);
  Result<Json> ask(const Json& request, double timeout_s = 5);

 private:
  explicit ControlClient(int fd) : fd_(fd) {}
  int fd_;
  std::string buffer_;
};

}  // namespace plumbline::app
