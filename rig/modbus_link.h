// One Modbus connection that never takes a stale or foreign reply for an answer.
//
// libmodbus frames, checks and times the bytes; what follows a fault is decided here, because its
// built-in recovery is not safe (3.1.6: after a late RTU reply each read returns the data of the
// request before, and link recovery may never return). The rules:
//   - every call has a deadline, connecting included;
//   - after a timeout or a reply that does not fit, the connection is closed and the unit counts as
//     out of step;
//   - a unit out of step is brought back by a read whose length no unanswered request has: a late
//     reply cannot pass for its answer, and as a server answers in order nothing older can follow;
//   - over TCP each request also carries a new transaction number.
#pragma once

#include <modbus/modbus.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "estimator/measurement.h"
#include "rig/modbus_frame.h"

namespace plumbline::rig {

using SteadyTime = std::chrono::steady_clock::time_point;

/// "tcp:HOST:PORT" or "rtu:DEVICE,115200,8E1", taken apart.
struct ModbusEndpoint {
  std::string text;  ///< as configured, for messages
  bool is_tcp = true;
  std::string host;
  std::string port;
  std::string device;
  int baud = 115200;
  int data_bits = 8;
  char parity = 'E';
  int stop_bits = 1;
};

/// ErrorCode::input when the text is not an endpoint. "rtu:DEVICE" alone means 115200,8E1.
Result<ModbusEndpoint> parse_modbus_endpoint(const std::string& text);

/// Registers that every unit lets us read, used to come back into step; at least two.
struct ProbeBlock {
  int address = 0;
  int count = 0;
};

/// Not thread safe: one owner.
class ModbusLink {
 public:
  /// `probe` per unit id that will be addressed.
  ModbusLink(ModbusEndpoint endpoint, std::chrono::milliseconds response_timeout,
             std::map<int, ProbeBlock> probe);
  ~ModbusLink();
  ModbusLink(const ModbusLink&) = delete;
  ModbusLink& operator=(const ModbusLink&) = delete;

  /// Connects (when not connected) and makes sure that `unit` answers in step.
  Result<void> synchronise(int unit, SteadyTime deadline);
  /// Holding registers, repeated once after a fault of the wire. An exception is not repeated.
  Result<std::vector<std::uint16_t>> read(int unit, int address, int count, SteadyTime deadline);
  /// Never repeated here: only the caller knows whether a write may be done twice.
  Result<void> write(int unit, int address, std::span<const std::uint16_t> words,
                     SteadyTime deadline);
  /// False after a fault of the wire, until the unit has answered in step again.
  bool in_step(int unit) const { return in_step_.contains(unit); }
  void close();

 private:
  struct ContextDeleter {
    void operator()(modbus_t* context) const;
  };

  Result<void> open(SteadyTime deadline);
  Result<void> resolve(SteadyTime deadline);
  Result<void> probe_once(int unit, SteadyTime deadline);
  void wait_past_late_reply(SteadyTime deadline);
  Result<std::vector<std::uint16_t>> read_once(int unit, int address, int count,
                                               SteadyTime deadline);
  /// Sends unit id and PDU; returns unit id and PDU of what came back, unchecked but for the frame.
  Result<std::vector<std::uint8_t>> exchange(std::span<const std::uint8_t> body,
                                             SteadyTime deadline);
  bool send(std::span<const std::uint8_t> body);
  bool input_pending(std::chrono::milliseconds wait) const;
  /// Closes after a fault of the wire and words it.
  tl::unexpected<Error> broken(int unit, const std::string& why);

  ModbusEndpoint endpoint_;
  std::chrono::milliseconds response_timeout_;
  std::map<int, ProbeBlock> probe_;
  std::string address_;  ///< the host resolved, so that reconnecting does not ask again
  std::unique_ptr<modbus_t, ContextDeleter> context_;
  std::uint16_t transaction_ = 0;
  bool worth_repeating_ = false;  ///< the last fault was a wrong reply, not silence
  std::set<int> in_step_;
  std::map<int, std::set<int>> unanswered_;  ///< lengths of requests without an answer, per unit
};

}  // namespace plumbline::rig
