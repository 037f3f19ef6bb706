// A Modbus server that does as it is told, byte by byte: what misbehaves on the wire is not left to
// a library. TCP on a free port, or RTU on the master side of a pseudo terminal.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "rig/modbus_head.h"

namespace plumbline::rig {

using Bytes = std::vector<std::uint8_t>;

/// What the server does with one request.
struct Misdeed {
  enum class Kind {
    late,               ///< answers after `delay`
    wrong_transaction,  ///< TCP
    wrong_unit,
    truncated,
    exception,
    silence,
    reset,  ///< TCP: closes with RST
    garbage,
    wrong_function,
    wrong_length,  ///< one register too few
    doubled,       ///< answers twice
    bad_crc,       ///< RTU
  } kind = Kind::silence;
  std::chrono::milliseconds delay{0};
  std::uint8_t exception = 0;
};

class ScriptedServer {
 public:
  enum class Line { tcp, rtu };
  explicit ScriptedServer(Line line);
  ~ScriptedServer();
  ScriptedServer(const ScriptedServer&) = delete;
  ScriptedServer& operator=(const ScriptedServer&) = delete;

  std::string endpoint() const { return endpoint_; }
  /// The next requests meet these, in order; after them all is well again.
  void misbehave(std::vector<Misdeed> script);
  void set_register(int address, std::uint16_t value);
  std::uint16_t get_register(int address) const;
  /// Every write to `address`, in order.
  std::vector<std::uint16_t> writes_to(int address) const;

 private:
  void run();
  void run_tcp();
  void run_rtu();
  /// Answers one request (unit and PDU); false closes the connection.
  bool serve(int fd, const Bytes& body, std::uint16_t transaction);
  Bytes carry_out(const Bytes& body);
  void send(int fd, const Bytes& body, std::uint16_t transaction, bool spoil_crc = false) const;

  Line line_;
  int listener_ = -1;
  int terminal_ = -1;  ///< master
  int held_ = -1;      ///< slave side, kept open
  std::string endpoint_;
  mutable std::mutex mutex_;
  std::map<int, std::uint16_t> registers_;
  std::vector<std::pair<int, std::uint16_t>> writes_;
  std::deque<Misdeed> script_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

inline constexpr std::chrono::milliseconds kResponseTimeout{150};
/// A call may take four response timeouts; the rest is for a busy machine.
inline constexpr std::chrono::milliseconds kCallLimit =
    4 * kResponseTimeout + std::chrono::seconds(2);

inline HeadConfig config_for(const ScriptedServer& server) {
  HeadConfig config;
  config.modbus = server.endpoint();
  config.response_timeout = kResponseTimeout;
  return config;
}

}  // namespace plumbline::rig
