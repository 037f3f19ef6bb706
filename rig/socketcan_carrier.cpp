#include "rig/socketcan_carrier.h"

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

namespace plumbline::rig {

SocketCanCarrier::SocketCanCarrier(std::string interface)
    : interface_(std::move(interface)), address_("can:" + interface_) {}

Result<void> SocketCanCarrier::open() {
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::rig, fmt::format("{}: {}", address_, why));
  };
  Descriptor socket(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW));
  if (!socket) {
    if (errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT) {
      return refuse(
          "this kernel has no CAN sockets: load the modules can and can-raw, or use unix:PATH");
    }
    return refuse(fmt::format("cannot open a CAN socket: {}", std::strerror(errno)));
  }
  const unsigned index = if_nametoindex(interface_.c_str());
  if (index == 0) {
    return refuse("no such interface: is the adapter plugged in (ip -brief link)?");
  }
  // Off by default; without it a bus that is off looks like a silent one.
  const can_err_mask_t every_error = CAN_ERR_MASK;
  const int on = 1;
  if (setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &every_error, sizeof every_error) !=
          0 ||
      setsockopt(socket.get(), SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on) != 0) {
    return refuse(fmt::format("cannot set up the CAN socket: {}", std::strerror(errno)));
  }
  // Interfaces without CAN FD refuse this; classic frames come all the same.
  setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
  receive_buffer_bytes_ = set_receive_buffer(socket.get());

  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(index);
  if (bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return refuse(fmt::format("cannot bind: {}", std::strerror(errno)));
  }
  socket_ = std::move(socket);
  last_drop_counter_ = 0;
  return {};
}

Result<std::optional<CanFrame>> SocketCanCarrier::receive(std::chrono::milliseconds timeout) {
  const Received received = receive_frame(socket_.get(), timeout);
  if (received.drop_counter) {
    drops_ += *received.drop_counter - last_drop_counter_;  // modulo 2³²
    last_drop_counter_ = *received.drop_counter;
  }
  switch (received.kind) {
    case Received::Kind::frame:
      return std::optional(received.frame);
    case Received::Kind::nothing:
      return std::optional<CanFrame>{};
    case Received::Kind::error:
      if (received.error == ENETDOWN) {
        CanFrame down;
        down.error = true;
        return std::optional(down);  // error class 0: the interface is down
      }
      return fail(ErrorCode::rig, fmt::format("{}: {}: is the adapter still plugged in?", address_,
                                              std::strerror(received.error)));
    case Received::Kind::closed:
    case Received::Kind::foreign:
      break;
  }
  return fail(ErrorCode::rig,
              fmt::format("{}: {} bytes that are no CAN frame", address_, received.size));
}

}  // namespace plumbline::rig
