// A simulated rig inside the test, and clients that talk to it over its real wires.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rig/sim/can_node.h"
#include "rig/sim/machine.h"
#include "rig/sim/modbus_server.h"
#include "rig/sim/world.h"
#include "tests/temp_folder.h"

namespace plumbline::sim {

/// Where the registers of each axis start.
inline constexpr int kDelta = 0x000;
inline constexpr int kTilt = 0x100;

/// Polls until `condition` holds; false when it does not within `seconds`.
inline bool eventually(const std::function<bool()>& condition, double seconds = 20) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// A libmodbus client at "tcp:HOST:PORT" or "rtu:DEVICE,115200,8N1".
class ModbusClient {
 public:
  explicit ModbusClient(const std::string& endpoint, int unit = 1) {
    if (endpoint.starts_with("tcp:")) {
      const std::size_t colon = endpoint.rfind(':');
      context_ = modbus_new_tcp(endpoint.substr(4, colon - 4).c_str(),
                                std::stoi(endpoint.substr(colon + 1)));
    } else {
      const std::string device = endpoint.substr(4, endpoint.find(',') - 4);
      context_ = modbus_new_rtu(device.c_str(), 115200, 'N', 8, 1);
    }
    modbus_set_slave(context_, unit);
    set_timeout_ms(5000);
    EXPECT_EQ(modbus_connect(context_), 0) << endpoint << ": " << modbus_strerror(errno);
  }
  ~ModbusClient() {
    modbus_close(context_);
    modbus_free(context_);
  }
  ModbusClient(const ModbusClient&) = delete;
  ModbusClient& operator=(const ModbusClient&) = delete;

  void set_timeout_ms(unsigned ms) {
    modbus_set_response_timeout(context_, ms / 1000, ms % 1000 * 1000);
  }
  modbus_t* get() { return context_; }

  /// 0, or errno as libmodbus sets it (EMBXILADD, ETIMEDOUT …).
  int try_read(int address, int count) {
    words_.assign(static_cast<std::size_t>(std::max(count, 1)), 0);
    return modbus_read_registers(context_, address, count, words_.data()) == count ? 0 : errno;
  }
  int try_write(int address, const std::vector<std::uint16_t>& words) {
    const int count = static_cast<int>(words.size());
    return modbus_write_registers(context_, address, count, words.data()) == count ? 0 : errno;
  }
  int read16(int address) {
    EXPECT_EQ(try_read(address, 1), 0) << modbus_strerror(errno);
    return words_[0];
  }
  std::int32_t read32(int address) {
    EXPECT_EQ(try_read(address, 2), 0) << modbus_strerror(errno);
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(words_[0]) << 16 | words_[1]);
  }
  void write(int address, const std::vector<std::uint16_t>& words) {
    EXPECT_EQ(try_write(address, words), 0) << modbus_strerror(errno);
  }
  bool bit(int base, int number) { return ((read16(base + 0x20) >> number) & 1) != 0; }
  void pulse(int base, std::uint16_t bits) {
    write(base, {bits});
    write(base, {0});
  }
  void move(int base, std::int32_t target, std::uint16_t sequence) {
    const auto bits = static_cast<std::uint32_t>(target);
    write(base + 0x02,
          {static_cast<std::uint16_t>(bits >> 16), static_cast<std::uint16_t>(bits & 0xFFFF)});
    write(base + 0x0A, {1, sequence});
    pulse(base, 1u << 3);
  }

 private:
  modbus_t* context_ = nullptr;
  std::vector<std::uint16_t> words_;
};

/// Raw bytes over a descriptor: for what libmodbus would not send or would not accept.
class RawBytes {
 public:
  /// TCP connection or serial device of `endpoint`.
  explicit RawBytes(const std::string& endpoint) : connection_(endpoint) {}
  int fd() { return modbus_get_socket(connection_.get()); }
  void send(const std::vector<std::uint8_t>& bytes) {
    EXPECT_EQ(::write(fd(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  /// `count` bytes, or fewer when no more come within `ms`, or the other side has closed.
  std::vector<int> receive(std::size_t count, int ms = 5000) {
    std::vector<int> result;
    pollfd readable{fd(), POLLIN, 0};
    while (result.size() < count && ::poll(&readable, 1, ms) > 0) {
      std::uint8_t byte = 0;
      last_ = ::read(fd(), &byte, 1);
      last_errno_ = errno;
      if (last_ != 1) break;
      result.push_back(byte);
    }
    return result;
  }
  bool closed() const { return last_ == 0; }
  bool reset() const { return last_ < 0 && last_errno_ == ECONNRESET; }

 private:
  ModbusClient connection_;
  ssize_t last_ = 1;
  int last_errno_ = 0;
};

/// Receives whole frames from a Unix SEQPACKET socket.
class FrameClient {
 public:
  explicit FrameClient(const std::string& endpoint)
      : socket_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    const std::string path = endpoint.substr(5);
    std::memcpy(name.sun_path, path.c_str(), path.size());
    EXPECT_EQ(::connect(socket_.get(), reinterpret_cast<sockaddr*>(&name), sizeof name), 0)
        << path << ": " << std::strerror(errno);
  }
  /// False when none comes within `ms`, or the other side has closed.
  bool next(can_frame& frame, int ms = 10000) {
    pollfd readable{socket_.get(), POLLIN, 0};
    return ::poll(&readable, 1, ms) > 0 &&
           ::recv(socket_.get(), &frame, sizeof frame, 0) == sizeof frame;
  }

 private:
  Descriptor socket_;
};

/// The parts of plumbline-simrig in this process.
class WireRig {
 public:
  explicit WireRig(const Faults& faults = {}, double speed = 50, const World& world = {})
      : machine(Drive(world.drive, faults, 1), Unit(world, 1), speed), faults_(faults) {}

  std::string serve_tcp() { return serve("tcp:127.0.0.1:0"); }
  std::string serve_rtu() { return serve("rtu:" + directory.file("tty")); }
  std::string serve_can(double rate_hz = 100) {
    auto output = open_frame_output("unix:" + directory.file("can"));
    EXPECT_TRUE(output.has_value());
    node =
        std::make_unique<CanNode>(machine, std::move(*output), NodeFrames(rate_hz, 16, faults_, 1));
    return node->endpoint();
  }

  TempFolder directory;
  Machine machine;
  std::unique_ptr<ModbusServer> modbus;
  std::unique_ptr<CanNode> node;

 private:
  std::string serve(const std::string& address) {
    auto server = ModbusServer::open(address, 1, machine, faults_, 1);
    EXPECT_TRUE(server.has_value()) << server.error().message;
    modbus = std::move(*server);
    return modbus->endpoint();
  }
  Faults faults_;
};

}  // namespace plumbline::sim
