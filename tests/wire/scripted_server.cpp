#include "tests/wire/scripted_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <pty.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cstdlib>
#include <stdexcept>

namespace plumbline::rig {

namespace {

constexpr int kUnit = 1;

std::uint8_t high(int value) { return static_cast<std::uint8_t>((value >> 8) & 0xFF); }
std::uint8_t low(int value) { return static_cast<std::uint8_t>(value & 0xFF); }

/// CRC-16 of Modbus over serial line V1.02, 6.2.2.
std::uint16_t crc16(const Bytes& bytes) {
  unsigned crc = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int i = 0; i < 8; ++i) crc = (crc & 1u) != 0 ? (crc >> 1) ^ 0xA001u : crc >> 1;
  }
  return static_cast<std::uint16_t>(crc);
}

bool readable(int fd, int timeout_ms) {
  pollfd descriptor{fd, POLLIN, 0};
  return poll(&descriptor, 1, timeout_ms) > 0 && (descriptor.revents & POLLIN) != 0;
}

}  // namespace

ScriptedServer::ScriptedServer(Line line) : line_(line) {
  if (line_ == Line::tcp) {
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
        listen(listener_, 8) != 0 ||
        getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
      throw std::runtime_error("no listening socket");
    }
    endpoint_ = "tcp:127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  } else {
    std::array<char, 128> name{};
    termios raw{};
    cfmakeraw(&raw);
    if (openpty(&terminal_, &held_, name.data(), &raw, nullptr) != 0) {
      throw std::runtime_error("no pseudo terminal");
    }
    endpoint_ = std::string("rtu:") + name.data() + ",115200,8E1";
  }
  thread_ = std::thread([this] { run(); });
}

ScriptedServer::~ScriptedServer() {
  stopping_ = true;
  thread_.join();
  for (const int fd : {listener_, terminal_, held_}) {
    if (fd >= 0) ::close(fd);
  }
}

void ScriptedServer::misbehave(std::vector<Misdeed> script) {
  const std::lock_guard lock(mutex_);
  script_.assign(script.begin(), script.end());
}

void ScriptedServer::set_register(int address, std::uint16_t value) {
  const std::lock_guard lock(mutex_);
  registers_[address] = value;
}

std::uint16_t ScriptedServer::get_register(int address) const {
  const std::lock_guard lock(mutex_);
  const auto it = registers_.find(address);
  return it == registers_.end() ? std::uint16_t{0} : it->second;
}

std::vector<std::uint16_t> ScriptedServer::writes_to(int address) const {
  const std::lock_guard lock(mutex_);
  std::vector<std::uint16_t> values;
  for (const auto& [at, value] : writes_) {
    if (at == address) values.push_back(value);
  }
  return values;
}

void ScriptedServer::run() { line_ == Line::tcp ? run_tcp() : run_rtu(); }

void ScriptedServer::run_tcp() {
  int client = -1;
  Bytes input;
  while (!stopping_) {
    if (readable(listener_, client < 0 ? 10 : 0)) {
      if (client >= 0) ::close(client);
      client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      input.clear();
    }
    if (client < 0 || !readable(client, 5)) continue;
    std::array<std::uint8_t, 512> buffer{};
    const ssize_t length = recv(client, buffer.data(), buffer.size(), 0);
    bool keep = length > 0;
    if (keep) input.insert(input.end(), buffer.begin(), buffer.begin() + length);
    while (keep && input.size() >= 6) {
      const std::size_t size = 6u + ((std::size_t{input[4]} << 8) | input[5]);
      if (input.size() < size) break;
      const auto transaction = static_cast<std::uint16_t>((input[0] << 8) | input[1]);
      const Bytes body(input.begin() + 6, input.begin() + static_cast<std::ptrdiff_t>(size));
      input.erase(input.begin(), input.begin() + static_cast<std::ptrdiff_t>(size));
      keep = serve(client, body, transaction);
    }
    if (!keep) {
      ::close(client);
      client = -1;
    }
  }
  if (client >= 0) ::close(client);
}

void ScriptedServer::run_rtu() {
  Bytes input;
  while (!stopping_) {
    if (!readable(terminal_, 5)) continue;
    std::array<std::uint8_t, 512> buffer{};
    const ssize_t length = ::read(terminal_, buffer.data(), buffer.size());
    if (length <= 0) continue;
    input.insert(input.end(), buffer.begin(), buffer.begin() + length);
    while (input.size() >= 8) {
      const std::size_t size = input[1] == 0x10 ? 9u + input[6] : 8u;
      if (input.size() < size) break;
      const Bytes body(input.begin(), input.begin() + static_cast<std::ptrdiff_t>(size) - 2);
      input.erase(input.begin(), input.begin() + static_cast<std::ptrdiff_t>(size));
      serve(terminal_, body, 0);
    }
  }
}

Bytes ScriptedServer::carry_out(const Bytes& body) {
  const int address = (body[2] << 8) | body[3];
  const int count = (body[4] << 8) | body[5];
  if (body[1] == 0x03) {
    Bytes reply = {body[0], 0x03, low(2 * count)};
    for (int i = 0; i < count; ++i) {
      const std::uint16_t value = registers_[address + i];
      reply.push_back(high(value));
      reply.push_back(low(value));
    }
    return reply;
  }
  for (int i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(7 + 2 * i);
    const auto value = static_cast<std::uint16_t>((body[at] << 8) | body[at + 1]);
    registers_[address + i] = value;
    writes_.emplace_back(address + i, value);
    // A rising START edge takes the command over into the echoes, as the drive does.
    const int base = address & ~0xFF;
    if (address + i == base && (value & (1u << 3)) != 0) {
      registers_[base + 0x26] = registers_[base + 0x02];
      registers_[base + 0x27] = registers_[base + 0x03];
      registers_[base + 0x2A] = registers_[base + 0x0B];
    }
  }
  return {body.begin(), body.begin() + 6};
}

void ScriptedServer::send(int fd, const Bytes& body, std::uint16_t transaction,
                          bool spoil_crc) const {
  Bytes frame;
  if (line_ == Line::tcp) {
    const int size = static_cast<int>(body.size());
    frame = {high(transaction), low(transaction), 0, 0, high(size), low(size)};
    frame.insert(frame.end(), body.begin(), body.end());
    ::send(fd, frame.data(), frame.size(), MSG_NOSIGNAL);
    return;
  }
  frame = body;
  const std::uint16_t crc = crc16(body);
  frame.push_back(low(crc));
  frame.push_back(static_cast<std::uint8_t>(high(crc) ^ (spoil_crc ? 0x55 : 0)));
  if (::write(fd, frame.data(), frame.size()) < 0) throw std::runtime_error("pty");
}

bool ScriptedServer::serve(int fd, const Bytes& body, std::uint16_t transaction) {
  if (body[0] != kUnit) return true;  // not for us
  std::optional<Misdeed> misdeed;
  Bytes reply;
  {
    const std::lock_guard lock(mutex_);
    if (!script_.empty()) {
      misdeed = script_.front();
      script_.pop_front();
    }
    if (misdeed && misdeed->kind == Misdeed::Kind::exception) {
      reply = {body[0], static_cast<std::uint8_t>(body[1] | 0x80), misdeed->exception};
    } else {
      reply = carry_out(body);
    }
  }
  if (!misdeed) {
    send(fd, reply, transaction);
    return true;
  }
  switch (misdeed->kind) {
    case Misdeed::Kind::exception:
      send(fd, reply, transaction);
      break;
    case Misdeed::Kind::late:
      std::this_thread::sleep_for(misdeed->delay);
      send(fd, reply, transaction);
      break;
    case Misdeed::Kind::wrong_transaction:
      send(fd, reply, static_cast<std::uint16_t>(transaction + 1));
      break;
    case Misdeed::Kind::wrong_unit:
      reply[0] = kUnit + 1;
      send(fd, reply, transaction);
      break;
    case Misdeed::Kind::truncated: {
      const Bytes cut = {0, 1, 0};
      if (::write(fd, cut.data(), cut.size()) < 0) return false;
      break;
    }
    case Misdeed::Kind::silence:
      break;
    case Misdeed::Kind::reset: {
      const linger at_once{1, 0};
      setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
      return false;
    }
    case Misdeed::Kind::garbage: {
      const Bytes garbage(40, 0xA5);
      if (::write(fd, garbage.data(), garbage.size()) < 0) return false;
      break;
    }
    case Misdeed::Kind::wrong_function:
      reply[1] = 0x04;
      send(fd, reply, transaction);
      break;
    case Misdeed::Kind::wrong_length:
      if (reply[1] == 0x03 && reply[2] > 2) {
        reply[2] = static_cast<std::uint8_t>(reply[2] - 2);
        reply.resize(reply.size() - 2);
      }
      send(fd, reply, transaction);
      break;
    case Misdeed::Kind::doubled:
      send(fd, reply, transaction);
      send(fd, reply, transaction);
      break;
    case Misdeed::Kind::bad_crc:
      send(fd, reply, transaction, true);
      break;
  }
  return true;
}

}  // namespace plumbline::rig
