#include "rig/socket_receive.h"

#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace plumbline::rig {

void Descriptor::reset(int fd) {
  if (fd_ >= 0) ::close(fd_);
  fd_ = fd;
}

int Descriptor::release() {
  const int fd = fd_;
  fd_ = -1;
  return fd;
}

std::optional<CanFrame> from_kernel_frame(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != CAN_MTU && bytes.size() != CANFD_MTU) return std::nullopt;
  // The head of both structures is the same: identifier, length, 3 further bytes, data.
  canfd_frame raw{};
  std::memcpy(&raw, bytes.data(), bytes.size());
  const std::size_t room = bytes.size() == CAN_MTU ? CAN_MAX_DLEN : CANFD_MAX_DLEN;
  if (raw.len > room) return std::nullopt;
  CanFrame frame;
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended || frame.error ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.length = raw.len;
  std::copy_n(raw.data, raw.len, frame.data.begin());
  return frame;
}

Received receive_frame(int socket, std::chrono::milliseconds timeout) {
  Received received;
  std::array<std::uint8_t, CANFD_MTU + 1> buffer{};  // one more, to notice longer messages
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint32_t))> control{};
  iovec part{buffer.data(), buffer.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;

  ssize_t length = -1;
  for (bool waited = false;; waited = true) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    length = recvmsg(socket, &message, MSG_DONTWAIT);
    if (length >= 0 || (errno != EAGAIN && errno != EINTR)) break;
    if (waited) return received;
    pollfd descriptor{socket, POLLIN, 0};
    if (poll(&descriptor, 1, static_cast<int>(timeout.count())) <= 0) return received;
  }
  if (length < 0) {
    received.kind = Received::Kind::error;
    received.error = errno;
    return received;
  }
  for (cmsghdr* part_of = CMSG_FIRSTHDR(&message); part_of != nullptr;
       part_of = CMSG_NXTHDR(&message, part_of)) {
    if (part_of->cmsg_level == SOL_SOCKET && part_of->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(part_of), sizeof drops);
      received.drop_counter = drops;
    }
  }
  received.size = static_cast<std::size_t>(length);
  if (length == 0) {
    received.kind = Received::Kind::closed;
    return received;
  }
  const auto frame = from_kernel_frame({buffer.data(), received.size});
  received.kind = frame ? Received::Kind::frame : Received::Kind::foreign;
  if (frame) received.frame = *frame;
  return received;
}

std::uint64_t set_receive_buffer(int socket) {
  const int wanted = 4 << 20;
  setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);
  int granted = 0;
  socklen_t size = sizeof granted;
  if (getsockopt(socket, SOL_SOCKET, SO_RCVBUF, &granted, &size) != 0) return 0;
  return static_cast<std::uint64_t>(granted);
}

}  // namespace plumbline::rig
