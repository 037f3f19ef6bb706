// Where the node's frames go: a SocketCAN interface, or a Unix socket where there is no CAN.
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <memory>
#include <string>

#include "estimator/measurement.h"

namespace plumbline::sim {

/// Used by one thread.
class FrameOutput {
 public:
  virtual ~FrameOutput() = default;

  /// Sends one frame to everybody who listens. Waits a bounded time for a slow receiver, then
  /// drops the frame and counts it. Fails when the carrier itself is gone.
  virtual Result<void> send(const can_frame& frame) = 0;
  /// Lets new receivers in and forgets those who left; to be called every few milliseconds.
  virtual void service() = 0;

  /// As rig.toml wants it: "unix:PATH" or "can:IFACE".
  const std::string& endpoint() const { return endpoint_; }
  std::uint64_t dropped() const { return dropped_; }

 protected:
  explicit FrameOutput(std::string endpoint) : endpoint_(std::move(endpoint)) {}
  std::string endpoint_;
  std::uint64_t dropped_ = 0;
};

/// `address` is "unix:PATH" (a listening SOCK_SEQPACKET socket, one whole struct can_frame per
/// packet, any number of receivers) or "can:IFACE". Errors: ErrorCode::input for an address that
/// cannot be read, ErrorCode::rig for one that cannot be had.
Result<std::unique_ptr<FrameOutput>> open_frame_output(const std::string& address);

}  // namespace plumbline::sim
