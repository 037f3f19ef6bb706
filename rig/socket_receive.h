// Receiving kernel CAN structures from a datagram-like socket: shared by can: and unix:.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "rig/carrier.h"

namespace plumbline::rig {

/// Owns a file descriptor.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() { reset(); }
  Descriptor(Descriptor&& other) noexcept : fd_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    if (this != &other) reset(other.release());
    return *this;
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  void reset(int fd = -1);

 private:
  int release();
  int fd_ = -1;
};

/// `struct can_frame` (16 bytes) or `struct canfd_frame` (72 bytes) as the kernel lays them out;
/// nothing when the bytes are neither.
std::optional<CanFrame> from_kernel_frame(std::span<const std::uint8_t> bytes);

/// What one receive brought.
struct Received {
  enum class Kind { frame, nothing, closed, foreign, error } kind = Kind::nothing;
  CanFrame frame;
  std::size_t size = 0;                       ///< bytes of the message
  int error = 0;                              ///< errno, for Kind::error
  std::optional<std::uint32_t> drop_counter;  ///< SO_RXQ_OVFL, when the kernel sent it
};

/// Takes what is there at once, or waits up to `timeout`. `socket` is non-blocking.
Received receive_frame(int socket, std::chrono::milliseconds timeout);

/// Asks for a receive buffer of 4 MB and returns what the kernel granted.
std::uint64_t set_receive_buffer(int socket);

}  // namespace plumbline::rig
