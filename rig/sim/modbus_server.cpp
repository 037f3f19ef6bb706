#include "rig/sim/modbus_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdlib>
#include <cstring>

namespace plumbline::sim {
namespace {

using std::chrono::milliseconds;

// How long a stop request may go unnoticed.
constexpr milliseconds kStopInterval{20};

constexpr std::uint8_t kReadHolding = 0x03;
constexpr std::uint8_t kWriteSingle = 0x06;
constexpr std::uint8_t kWriteMultiple = 0x10;
constexpr int kMaxRead = 125;
constexpr int kMaxWrite = 123;

std::string reason() { return std::strerror(errno); }

tl::unexpected<Error> unavailable(const std::string& address, const std::string& why) {
  return fail(ErrorCode::rig, fmt::format("{}: {}", address, why));
}

void sleep_unless_stopped(double seconds, const std::stop_token& stop) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!stop.stop_requested() && std::chrono::steady_clock::now() < until) {
    std::this_thread::sleep_for(milliseconds(1));
  }
}

int word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return bytes[at] << 8 | bytes[at + 1];
}

/// Closing with SO_LINGER at zero sends RST instead of FIN.
void reset_on_close(int fd) {
  const linger now{.l_onoff = 1, .l_linger = 0};
  ::setsockopt(fd, SOL_SOCKET, SO_LINGER, &now, sizeof now);
}

}  // namespace

Result<std::unique_ptr<ModbusServer>> ModbusServer::open(const std::string& address, int unit_id,
                                                         Machine& machine, const Faults& faults,
                                                         std::uint64_t seed) {
  std::unique_ptr<ModbusServer> server(new ModbusServer(machine, unit_id, faults, seed));
  Result<void> opened;
  if (address.starts_with("tcp:")) {
    opened = server->open_tcp(address.substr(4));
  } else if (address.starts_with("rtu:") && address.size() > 4) {
    opened = server->open_rtu(address.substr(4));
  } else {
    return fail(ErrorCode::input,
                fmt::format("--modbus {}: expected tcp:ADDRESS:PORT or rtu:LINK", address));
  }
  if (opened) opened = server->prepare();
  if (!opened) return fail(opened.error());
  server->thread_ =
      std::jthread([raw = server.get()](const std::stop_token& stop) { raw->run(stop); });
  return server;
}

ModbusServer::ModbusServer(Machine& machine, int unit_id, const Faults& faults, std::uint64_t seed)
    : machine_(machine), unit_id_(unit_id), faults_(faults, FaultStage::modbus, seed) {}

ModbusServer::~ModbusServer() {
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
  }
  // The descriptors are ours; modbus_free() does not close them.
  if (!link_.empty()) ::unlink(link_.c_str());
}

Result<void> ModbusServer::open_tcp(const std::string& host_and_port) {
  const std::string address = "tcp:" + host_and_port;
  const std::size_t colon = host_and_port.rfind(':');
  sockaddr_in name{};
  name.sin_family = AF_INET;
  const std::string host = colon == std::string::npos ? "" : host_and_port.substr(0, colon);
  std::uint16_t port = 0;
  const char* const end = host_and_port.data() + host_and_port.size();
  const char* const digits = host_and_port.data() + std::min(colon + 1, host_and_port.size());
  const auto parsed = std::from_chars(digits, end, port);
  if (::inet_pton(AF_INET, host.c_str(), &name.sin_addr) != 1 || parsed.ec != std::errc() ||
      parsed.ptr != end) {
    return fail(ErrorCode::input,
                fmt::format("--modbus {}: expected tcp:ADDRESS:PORT with an IPv4 address and a "
                            "port of 0 to 65535",
                            address));
  }
  name.sin_port = htons(port);

  listener_ = Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  ::setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  auto* const generic = reinterpret_cast<sockaddr*>(&name);
  if (::bind(listener_.get(), generic, sizeof name) != 0 || ::listen(listener_.get(), 16) != 0) {
    return unavailable(address, fmt::format("cannot listen there: {}", reason()));
  }
  socklen_t size = sizeof name;
  ::getsockname(listener_.get(), generic, &size);
  endpoint_ = fmt::format("tcp:{}:{}", host, ntohs(name.sin_port));
  return {};
}

Result<void> ModbusServer::open_rtu(const std::string& link) {
  const std::string address = "rtu:" + link;
  Descriptor master(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
  std::array<char, 64> terminal_name{};
  if (!master || ::grantpt(master.get()) != 0 || ::unlockpt(master.get()) != 0 ||
      ::ptsname_r(master.get(), terminal_name.data(), terminal_name.size()) != 0) {
    return unavailable(address, fmt::format("no pseudo terminal to be had: {}", reason()));
  }
  terminal_ = Descriptor(::open(terminal_name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  termios settings{};
  if (!terminal_ || ::tcgetattr(terminal_.get(), &settings) != 0) {
    return unavailable(address, fmt::format("{}: {}", terminal_name.data(), reason()));
  }
  ::cfmakeraw(&settings);
  ::cfsetspeed(&settings, B115200);
  ::tcsetattr(terminal_.get(), TCSANOW, &settings);

  // A rig that was killed leaves its link behind; anything else there is not ours to replace.
  struct stat existing {};
  if (::lstat(link.c_str(), &existing) == 0 && S_ISLNK(existing.st_mode)) ::unlink(link.c_str());
  if (::symlink(terminal_name.data(), link.c_str()) != 0) {
    return unavailable(address, fmt::format("cannot make the link: {}", reason()));
  }
  link_ = link;
  // A pseudo terminal has no parity, and the C library refuses to set one where nothing else is to
  // be changed, as for the client that comes after one that was killed.
  endpoint_ = address + ",115200,8N1";
  clients_.push_back(std::move(master));
  return {};
}

Result<void> ModbusServer::prepare() {
  std::array<int, 2> pair{-1, -1};
  make_context();
  mapping_.reset(modbus_mapping_new(0, 0, kRegisterEnd, 0));
  if (!context_ || !mapping_ ||
      ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
    return unavailable(endpoint_, reason());
  }
  capture_in_ = Descriptor(pair[0]);
  capture_out_ = Descriptor(pair[1]);
  return {};
}

void ModbusServer::make_context() {
  // The names are never used: the context is not connected but given our descriptors one by one.
  context_.reset(is_tcp() ? modbus_new_tcp("127.0.0.1", 0)
                          : modbus_new_rtu("/dev/null", 115200, 'E', 8, 1));
  if (!context_) return;
  modbus_set_slave(context_.get(), unit_id_);
  // libmodbus waits this long before it refuses a malformed request; our clients need not.
  modbus_set_response_timeout(context_.get(), 0, 1);
  // Half a request must not keep other clients waiting.
  modbus_set_byte_timeout(context_.get(), 0, 200000);
}

std::size_t ModbusServer::header_length() const {
  return static_cast<std::size_t>(modbus_get_header_length(context_.get()));
}

void ModbusServer::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::vector<pollfd> ready;
    for (const Descriptor& client : clients_) ready.push_back({client.get(), POLLIN, 0});
    if (is_tcp()) ready.push_back({listener_.get(), POLLIN, 0});
    if (::poll(ready.data(), ready.size(), static_cast<int>(kStopInterval.count())) <= 0) continue;
    // From the back, so that closing one leaves the others where they are.
    for (std::size_t i = clients_.size(); i-- > 0;) {
      if (ready[i].revents == 0 || serve(i, stop)) continue;
      clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    if (is_tcp() && ready.back().revents != 0) accept_client();
  }
}

void ModbusServer::accept_client() {
  Descriptor client(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (!client) return;
  const int on = 1;
  ::setsockopt(client.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  clients_.push_back(std::move(client));
}

bool ModbusServer::serve(std::size_t client, const std::stop_token& stop) {
  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> bytes{};
  modbus_set_socket(context_.get(), clients_[client].get());
  const int length = modbus_receive(context_.get(), bytes.data());
  if (length < 0)
    return !is_tcp();  // a serial line goes on after noise, a stream has lost its place
  const std::span request(bytes.data(), static_cast<std::size_t>(length));
  if (length == 0) {
    // For another unit on the serial line. libmodbus would now take the next request for that
    // unit's reply and swallow it; but there is no other unit here, so it has to forget about it.
    make_context();
    return true;
  }
  if (request.size() <= header_length() || request[header_length() - 1] != unit_id_) return true;
  return answer(client, request, stop);
}

bool ModbusServer::answer(std::size_t client, std::span<std::uint8_t> request,
                          const std::stop_token& stop) {
  const std::vector<const Fault*> faults = machine_.with_drive([&](Drive& drive, double t_s) {
    drive.note_request(std::chrono::steady_clock::now());
    return faults_.event(t_s, drive.moves());
  });
  const auto acting = [&](FaultKind kind) -> const Fault* {
    const auto found =
        std::find_if(faults.begin(), faults.end(), [&](const Fault* f) { return f->kind == kind; });
    return found == faults.end() ? nullptr : *found;
  };

  // Faults by which the request never reaches the drive.
  if (acting(FaultKind::modbus_silence)) return true;
  if (acting(FaultKind::modbus_half_open)) {
    if (!is_tcp()) return true;
    forgotten_.push_back(std::move(clients_[client]));
    return false;
  }
  if (acting(FaultKind::modbus_reset)) {
    if (!is_tcp()) return true;
    reset_on_close(clients_[client].get());
    return false;
  }

  // Faults of the reply. The reply repeats unit and transaction of the request, so it is enough to
  // falsify those before it is made: the frame around them stays well formed.
  const Fault* forced = acting(FaultKind::modbus_exception);
  if (acting(FaultKind::modbus_wrong_unit)) ++request[header_length() - 1];
  if (acting(FaultKind::modbus_wrong_transaction) && is_tcp()) ++request[1];
  std::vector<std::uint8_t> reply =
      reply_to(request, forced ? static_cast<unsigned>(forced->value) : 0);
  if (acting(FaultKind::modbus_bad_crc) && !is_tcp() && !reply.empty()) reply.back() ^= 0x55;
  if (const Fault* cut = acting(FaultKind::modbus_truncated)) {
    reply.resize(std::min(reply.size(), static_cast<std::size_t>(cut->value)));
  }
  machine_.wait_until_sent();
  if (const Fault* late = acting(FaultKind::modbus_late)) sleep_unless_stopped(late->value, stop);

  const int fd = clients_[client].get();
  const ssize_t sent = is_tcp() ? ::send(fd, reply.data(), reply.size(), MSG_NOSIGNAL)
                                : ::write(fd, reply.data(), reply.size());
  return !is_tcp() || sent == static_cast<ssize_t>(reply.size());
}

std::vector<std::uint8_t> ModbusServer::reply_to(std::span<const std::uint8_t> request,
                                                 unsigned exception) {
  const unsigned code = exception != 0 ? exception : carry_out(request.subspan(header_length()));
  modbus_set_socket(context_.get(), capture_in_.get());
  if (code != 0) {
    modbus_reply_exception(context_.get(), request.data(), code);
  } else {
    modbus_reply(context_.get(), request.data(), static_cast<int>(request.size()), mapping_.get());
  }
  std::vector<std::uint8_t> reply(MODBUS_TCP_MAX_ADU_LENGTH);
  const ssize_t length = ::recv(capture_out_.get(), reply.data(), reply.size(), MSG_DONTWAIT);
  reply.resize(static_cast<std::size_t>(std::max<ssize_t>(length, 0)));
  return reply;
}

unsigned ModbusServer::carry_out(std::span<const std::uint8_t> pdu) {
  const std::uint8_t function = pdu[0];
  if (function != kReadHolding && function != kWriteSingle && function != kWriteMultiple) {
    return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
  }
  const int address = word_at(pdu, 1);
  const int count = function == kWriteSingle ? 1 : word_at(pdu, 3);
  const bool is_write = function != kReadHolding;
  std::vector<std::uint16_t> words;
  if (is_write) {
    const std::size_t first = function == kWriteSingle ? 3 : 6;
    const std::size_t bytes = function == kWriteSingle ? 2 : pdu[5];
    if (count < 1 || count > kMaxWrite || bytes != 2 * static_cast<std::size_t>(count) ||
        pdu.size() < first + bytes) {
      return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
    }
    for (std::size_t i = 0; i < bytes; i += 2) {
      words.push_back(static_cast<std::uint16_t>(word_at(pdu, first + i)));
    }
  } else if (count < 1 || count > kMaxRead) {
    return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
  }
  return machine_.with_drive([&](Drive& drive, double t_s) {
    const Refusal refusal =
        is_write ? Drive::check_write(address, words) : Drive::check_read(address, count);
    if (refusal != Refusal::none) return static_cast<unsigned>(refusal);
    if (is_write) drive.write(address, words, t_s);
    drive.image(t_s, {mapping_->tab_registers, static_cast<std::size_t>(kRegisterEnd)});
    return 0u;
  });
}

}  // namespace plumbline::sim
