// The simulated drive on the wire: a Modbus server over TCP or over a pseudo terminal (RTU).
#pragma once

#include <modbus/modbus.h>

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "estimator/measurement.h"
#include "rig/sim/descriptor.h"
#include "rig/sim/faults.h"
#include "rig/sim/machine.h"

namespace plumbline::sim {

/// Serves FC03, FC06 and FC16 for one unit id; other unit ids meet silence, as on a serial line.
/// libmodbus frames the requests and the replies. A reply is first made into a local socket pair
/// and read back, so that a fault can spoil its bytes before they go out.
class ModbusServer {
 public:
  /// `address` is "tcp:ADDRESS:PORT" (port 0 takes a free one) or "rtu:LINK": a pseudo terminal,
  /// 115200 8N1, with LINK as a symbolic link to it. Serves from now on, on a thread of its own,
  /// until destroyed. `machine` must live longer. Errors: ErrorCode::input for an address that
  /// cannot be read, ErrorCode::rig for one that cannot be had.
  static Result<std::unique_ptr<ModbusServer>> open(const std::string& address, int unit_id,
                                                    Machine& machine, const Faults& faults,
                                                    std::uint64_t seed);
  ~ModbusServer();
  ModbusServer(const ModbusServer&) = delete;
  ModbusServer& operator=(const ModbusServer&) = delete;

  /// Where a client finds it, as rig.toml wants it: "tcp:127.0.0.1:40123", "rtu:LINK,115200,8N1".
  const std::string& endpoint() const { return endpoint_; }

 private:
  ModbusServer(Machine& machine, int unit_id, const Faults& faults, std::uint64_t seed);
  Result<void> open_tcp(const std::string& host_and_port);
  Result<void> open_rtu(const std::string& link);
  Result<void> prepare();
  void make_context();

  void run(const std::stop_token& stop);
  void accept_client();
  /// Serves one request; false when the connection is to be closed.
  bool serve(std::size_t client, const std::stop_token& stop);
  bool answer(std::size_t client, std::span<std::uint8_t> request, const std::stop_token& stop);
  /// Carries the request out and returns the reply's bytes; `exception` 0 = none is forced.
  std::vector<std::uint8_t> reply_to(std::span<const std::uint8_t> request, unsigned exception);
  /// The exception code that the request deserves, 0 when it has been carried out.
  unsigned carry_out(std::span<const std::uint8_t> pdu);
  bool is_tcp() const { return static_cast<bool>(listener_); }
  std::size_t header_length() const;

  struct FreeContext {
    void operator()(modbus_t* context) const { modbus_free(context); }
    void operator()(modbus_mapping_t* mapping) const { modbus_mapping_free(mapping); }
  };

  Machine& machine_;
  int unit_id_;
  FaultInjector faults_;
  std::unique_ptr<modbus_t, FreeContext> context_;
  std::unique_ptr<modbus_mapping_t, FreeContext> mapping_;
  Descriptor capture_in_, capture_out_;
  Descriptor listener_;                ///< TCP
  Descriptor terminal_;                ///< RTU: kept open, or the master would see a hang-up
  std::string link_;                   ///< RTU: removed at the end
  std::vector<Descriptor> clients_;    ///< RTU: the one pseudo terminal
  std::vector<Descriptor> forgotten_;  ///< half-open connections: never read, never closed
  std::string endpoint_;
  std::jthread thread_;
};

}  // namespace plumbline::sim
