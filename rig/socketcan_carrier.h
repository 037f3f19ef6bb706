// can:IFACE, a SocketCAN interface.
#pragma once

#include <string>

#include "rig/carrier.h"
#include "rig/socket_receive.h"

namespace plumbline::rig {

class SocketCanCarrier : public Carrier {
 public:
  explicit SocketCanCarrier(std::string interface);

  Result<void> open() override;
  /// A link that goes down is reported as an error frame ("interface down"); the same socket goes
  /// on when the link comes back. An interface that is gone is a failure.
  Result<std::optional<CanFrame>> receive(std::chrono::milliseconds timeout) override;
  std::uint64_t kernel_drops() const override { return drops_; }
  std::uint64_t receive_buffer_bytes() const override { return receive_buffer_bytes_; }
  const std::string& address() const override { return address_; }

 private:
  std::string interface_;
  std::string address_;
  Descriptor socket_;
  std::uint64_t receive_buffer_bytes_ = 0;
  std::uint64_t drops_ = 0;
  std::uint32_t last_drop_counter_ = 0;  ///< of this socket
};

}  // namespace plumbline::rig
