// unix:PATH, CAN frames as whole messages over a SOCK_SEQPACKET socket: for machines without CAN.
#pragma once

#include <string>

#include "rig/carrier.h"
#include "rig/socket_receive.h"

namespace plumbline::rig {

class UnixCarrier : public Carrier {
 public:
  explicit UnixCarrier(std::string path);

  Result<void> open() override;
  Result<std::optional<CanFrame>> receive(std::chrono::milliseconds timeout) override;
  std::uint64_t receive_buffer_bytes() const override { return receive_buffer_bytes_; }
  const std::string& address() const override { return address_; }

 private:
  std::string path_;
  std::string address_;
  Descriptor socket_;
  std::uint64_t receive_buffer_bytes_ = 0;
};

}  // namespace plumbline::rig
