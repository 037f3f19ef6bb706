// What brings CAN frames to us. Everything above receive() is the same code for all carriers.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "estimator/measurement.h"

namespace plumbline::rig {

/// One frame, classic or FD.
struct CanFrame {
  std::uint32_t id = 0;   ///< without flag bits
  bool extended = false;  ///< 29-bit identifier
  bool remote = false;
  bool error = false;  ///< error frame: `id` is the error class of linux/can/error.h
  std::uint8_t length = 0;
  std::array<std::uint8_t, 64> data{};

  std::span<const std::uint8_t> bytes() const { return {data.data(), length}; }
};

/// One thread uses a carrier. Failures are ErrorCode::rig and name the address.
class Carrier {
 public:
  virtual ~Carrier() = default;

  /// May be called again after a failure.
  virtual Result<void> open() = 0;
  /// The next frame, or nothing when `timeout` passes first.
  virtual Result<std::optional<CanFrame>> receive(std::chrono::milliseconds timeout) = 0;
  /// Frames that the kernel had no room for, since the first open().
  virtual std::uint64_t kernel_drops() const { return 0; }
  /// Size of the kernel's receive buffer as read back; 0 where there is none.
  virtual std::uint64_t receive_buffer_bytes() const { return 0; }
  /// True for a log: it has an end, and its frames wait for us.
  virtual bool recorded() const { return false; }
  /// True when a log has been read to its end.
  virtual bool ended() const { return false; }
  virtual const std::string& address() const = 0;
};

/// "can:IFACE", "unix:PATH" or "log:FILE"; anything else is ErrorCode::input.
Result<std::unique_ptr<Carrier>> make_carrier(const std::string& address);

/// "bus-off, no acknowledgement" of an error frame.
std::string error_frame_text(const CanFrame& frame);

}  // namespace plumbline::rig
