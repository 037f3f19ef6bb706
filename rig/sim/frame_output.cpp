#include "rig/sim/frame_output.h"

#include <fmt/format.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <tuple>
#include <vector>

#include "rig/sim/descriptor.h"

namespace plumbline::sim {
namespace {

using std::chrono::milliseconds;

// Longer than any pause of a healthy receiver on a loaded machine, shorter than its silence alarm.
constexpr milliseconds kPatience{1000};

std::string reason() { return std::strerror(errno); }

class UnixOutput final : public FrameOutput {
 public:
  explicit UnixOutput(const std::string& path) : FrameOutput("unix:" + path), path_(path) {}
  ~UnixOutput() override {
    if (listener_) ::unlink(path_.c_str());
  }

  Result<void> open() {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    if (path_.empty() || path_.size() >= sizeof name.sun_path) {
      return fail(ErrorCode::input, fmt::format("--can {}: the path must have 1 to {} characters",
                                                endpoint_, sizeof name.sun_path - 1));
    }
    std::memcpy(name.sun_path, path_.c_str(), path_.size());
    // A rig that was killed leaves its socket behind; anything else there is not ours to remove.
    struct stat existing {};
    if (::lstat(path_.c_str(), &existing) == 0 && S_ISSOCK(existing.st_mode)) {
      ::unlink(path_.c_str());
    }
    Descriptor listener(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (::bind(listener.get(), reinterpret_cast<const sockaddr*>(&name), sizeof name) != 0 ||
        ::listen(listener.get(), 16) != 0) {
      return fail(ErrorCode::rig, fmt::format("{}: cannot listen there: {}", endpoint_, reason()));
    }
    listener_ = std::move(listener);
    return {};
  }

  Result<void> send(const can_frame& frame) override {
    std::erase_if(receivers_, [&](Receiver& receiver) { return !deliver(receiver, frame); });
    return {};
  }

  void service() override {
    for (;;) {
      Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
      if (!socket) return;
      receivers_.push_back({std::move(socket)});
    }
  }

 private:
  struct Receiver {
    Descriptor socket;
    bool stuck = false;  ///< did not read for kPatience: not waited for until it reads again
  };

  /// False when the receiver has gone.
  bool deliver(Receiver& receiver, const can_frame& frame) {
    const auto until = std::chrono::steady_clock::now() + kPatience;
    for (;;) {
      if (::send(receiver.socket.get(), &frame, sizeof frame, MSG_NOSIGNAL) == sizeof frame) {
        receiver.stuck = false;
        return true;
      }
      if (errno != EAGAIN && errno != EINTR) return false;
      const auto left = std::chrono::ceil<milliseconds>(until - std::chrono::steady_clock::now());
      if (receiver.stuck || left.count() <= 0) {
        receiver.stuck = true;
        ++dropped_;
        return true;
      }
      pollfd writable{receiver.socket.get(), POLLOUT, 0};
      ::poll(&writable, 1, static_cast<int>(left.count()));
    }
  }

  std::string path_;
  Descriptor listener_;
  std::vector<Receiver> receivers_;
};

class SocketCanOutput final : public FrameOutput {
 public:
  explicit SocketCanOutput(const std::string& interface)
      : FrameOutput("can:" + interface), interface_(interface) {}

  Result<void> open() {
    socket_ = Descriptor(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
    if (!socket_) {
      return fail(ErrorCode::rig,
                  fmt::format("{}: this kernel has no SocketCAN ({}); use --can unix:PATH instead",
                              endpoint_, reason()));
    }
    sockaddr_can name{};
    name.can_family = AF_CAN;
    name.can_ifindex = static_cast<int>(::if_nametoindex(interface_.c_str()));
    if (name.can_ifindex == 0 ||
        ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&name), sizeof name) != 0) {
      return fail(ErrorCode::rig,
                  fmt::format("{}: no such CAN interface, or it is down: {}", endpoint_, reason()));
    }
    // We never read: without this the frames of others would fill our receive buffer.
    ::setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);
    return {};
  }

  Result<void> send(const can_frame& frame) override {
    const auto until = std::chrono::steady_clock::now() + kPatience;
    while (::write(socket_.get(), &frame, sizeof frame) != sizeof frame) {
      // A full transmit queue, or an interface that is down for a while, as after bus-off; one that
      // was unplugged comes back under the same name, but is another one.
      const bool gone = errno == ENODEV || errno == ENXIO;
      if (!gone && errno != ENOBUFS && errno != EAGAIN && errno != EINTR && errno != ENETDOWN) {
        return fail(ErrorCode::rig, fmt::format("{}: cannot send: {}", endpoint_, reason()));
      }
      if (gone) std::ignore = open();  // tried by the next write, here or of the next frame
      if (stuck_ || std::chrono::steady_clock::now() >= until) {
        stuck_ = true;
        ++dropped_;
        return {};
      }
      std::this_thread::sleep_for(milliseconds(1));
    }
    stuck_ = false;
    return {};
  }

  void service() override {}

 private:
  std::string interface_;
  Descriptor socket_;
  bool stuck_ = false;  ///< nothing went out for kPatience: not waited for until something does
};

template <class Output>
Result<std::unique_ptr<FrameOutput>> opened(std::unique_ptr<Output> output) {
  if (auto done = output->open(); !done) return fail(done.error());
  return std::unique_ptr<FrameOutput>(std::move(output));
}

}  // namespace

Result<std::unique_ptr<FrameOutput>> open_frame_output(const std::string& address) {
  if (address.starts_with("unix:")) return opened(std::make_unique<UnixOutput>(address.substr(5)));
  if (address.starts_with("can:") && address.size() > 4) {
    return opened(std::make_unique<SocketCanOutput>(address.substr(4)));
  }
  return fail(ErrorCode::input,
              fmt::format("--can {}: expected unix:PATH or can:INTERFACE", address));
}

}  // namespace plumbline::sim
