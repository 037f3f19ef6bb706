#include "rig/unix_carrier.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <thread>

namespace plumbline::rig {

namespace {

constexpr std::chrono::milliseconds kConnectTimeout{2000};
constexpr std::chrono::milliseconds kConnectPause{10};

}  // namespace

UnixCarrier::UnixCarrier(std::string path) : path_(std::move(path)), address_("unix:" + path_) {}

Result<void> UnixCarrier::open() {
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::rig, fmt::format("{}: {}", address_, why));
  };
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path_.empty() || path_.size() >= sizeof address.sun_path) {
    return refuse(fmt::format("the path must have 1 to {} bytes", sizeof address.sun_path - 1));
  }
  std::memcpy(address.sun_path, path_.data(), path_.size());
  Descriptor socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket) return refuse(std::strerror(errno));

  const auto deadline = std::chrono::steady_clock::now() + kConnectTimeout;
  while (connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    if (errno != EAGAIN && errno != EINTR) {
      return refuse(fmt::format("cannot connect: {}: is the node running?", std::strerror(errno)));
    }
    // EAGAIN: the queue of those who want to connect is full.
    if (std::chrono::steady_clock::now() >= deadline) {
      return refuse("nobody accepts the connection: is the node running?");
    }
    std::this_thread::sleep_for(kConnectPause);
  }
  receive_buffer_bytes_ = set_receive_buffer(socket.get());
  socket_ = std::move(socket);
  return {};
}

Result<std::optional<CanFrame>> UnixCarrier::receive(std::chrono::milliseconds timeout) {
  const Received received = receive_frame(socket_.get(), timeout);
  switch (received.kind) {
    case Received::Kind::frame:
      return std::optional(received.frame);
    case Received::Kind::nothing:
      return std::optional<CanFrame>{};
    case Received::Kind::closed:
      return fail(ErrorCode::rig, fmt::format("{}: the node has closed the connection", address_));
    case Received::Kind::error:
      return fail(ErrorCode::rig, fmt::format("{}: {}", address_, std::strerror(received.error)));
    case Received::Kind::foreign:
      break;
  }
  return fail(ErrorCode::rig,
              fmt::format("{}: a message of {} bytes is no CAN frame", address_, received.size));
}

}  // namespace plumbline::rig
