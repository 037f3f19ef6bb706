#include "rig/modbus_link.h"

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cassert>
#include <charconv>
#include <future>
#include <thread>

namespace plumbline::rig {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// After the first byte of a late reply the rest follows without a pause longer than this.
constexpr milliseconds kQuietLine{50};
constexpr int kProbeRepeats = 2;
/// Stands for a write among the lengths of unanswered reads.
constexpr int kWriteLength = 0;

milliseconds until(SteadyTime deadline) {
  const auto left = std::chrono::duration_cast<milliseconds>(deadline - steady_clock::now());
  return std::max(left, milliseconds{0});
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

bool whole_number(const std::string& text, int min, int max, int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= min && value <= max;
}

/// Numeric address of a host. getaddrinfo() has no time limit of its own, so it runs beside.
Result<std::string> resolve_host(const std::string& host, milliseconds timeout) {
  std::promise<std::string> promise;
  std::future<std::string> answer = promise.get_future();
  std::thread([host, promise = std::move(promise)]() mutable {
    addrinfo hints{};
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    std::array<char, NI_MAXHOST> name{};
    if (getaddrinfo(host.c_str(), nullptr, &hints, &found) == 0 && found != nullptr) {
      getnameinfo(found->ai_addr, found->ai_addrlen, name.data(), name.size(), nullptr, 0,
                  NI_NUMERICHOST);
      freeaddrinfo(found);
    }
    promise.set_value(name.data());
  }).detach();
  if (answer.wait_for(timeout) != std::future_status::ready) {
    return fail(ErrorCode::rig, fmt::format("no answer when asking for the address of {}", host));
  }
  std::string address = answer.get();
  if (address.empty()) return fail(ErrorCode::rig, fmt::format("no host named {}", host));
  return address;
}

}  // namespace

Result<ModbusEndpoint> parse_modbus_endpoint(const std::string& text) {
  const auto refuse = [&](const char* why) {
    return fail(
        ErrorCode::input,
        fmt::format("modbus = \"{}\": {}; give tcp:HOST:PORT or rtu:DEVICE,115200,8E1", text, why));
  };
  ModbusEndpoint endpoint;
  endpoint.text = text;
  if (text.starts_with("tcp:")) {
    const std::string rest = text.substr(4);
    const std::size_t colon = rest.rfind(':');
    if (colon == std::string::npos || colon == 0) return refuse("host or port is missing");
    endpoint.host = rest.substr(0, colon);
    endpoint.port = rest.substr(colon + 1);
    if (endpoint.host.front() == '[' && endpoint.host.back() == ']') {
      endpoint.host = endpoint.host.substr(1, endpoint.host.size() - 2);  // [IPv6]
    }
    int port = 0;
    if (!whole_number(endpoint.port, 1, 65535, port)) return refuse("the port is not 1 … 65535");
    return endpoint;
  }
  if (text.starts_with("rtu:")) {
    endpoint.is_tcp = false;
    const auto parts = split(text.substr(4), ',');
    endpoint.device = parts[0];
    if (endpoint.device.empty()) return refuse("the device is missing");
    if (parts.size() > 3) return refuse("too many commas");
    if (parts.size() > 1 && !whole_number(parts[1], 1200, 4000000, endpoint.baud)) {
      return refuse("the baud rate is not a number");
    }
    if (parts.size() > 2) {
      const std::string& mode = parts[2];
      const bool right = mode.size() == 3 && (mode[0] == '7' || mode[0] == '8') &&
                         (mode[1] == 'N' || mode[1] == 'E' || mode[1] == 'O') &&
                         (mode[2] == '1' || mode[2] == '2');
      if (!right) return refuse("the line mode is not like 8E1");
      endpoint.data_bits = mode[0] - '0';
      endpoint.parity = mode[1];
      endpoint.stop_bits = mode[2] - '0';
    }
    return endpoint;
  }
  return refuse("neither tcp: nor rtu:");
}

void ModbusLink::ContextDeleter::operator()(modbus_t* context) const {
  modbus_close(context);
  modbus_free(context);
}

ModbusLink::ModbusLink(ModbusEndpoint endpoint, milliseconds response_timeout,
                       std::map<int, ProbeBlock> probe)
    : endpoint_(std::move(endpoint)),
      response_timeout_(response_timeout),
      probe_(std::move(probe)) {}

ModbusLink::~ModbusLink() = default;

void ModbusLink::close() {
  context_.reset();
  in_step_.clear();
}

tl::unexpected<Error> ModbusLink::broken(int unit, const std::string& why) {
  close();
  return fail(ErrorCode::rig, fmt::format("{} unit {}: {}", endpoint_.text, unit, why));
}

bool ModbusLink::input_pending(milliseconds wait) const {
  pollfd descriptor{modbus_get_socket(context_.get()), POLLIN, 0};
  return poll(&descriptor, 1, static_cast<int>(wait.count())) > 0;
}

Result<void> ModbusLink::open(SteadyTime deadline) {
  if (context_) return {};
  if (endpoint_.is_tcp && address_.empty()) {
    auto address = resolve_host(endpoint_.host, until(deadline));
    if (!address) {
      return fail(ErrorCode::rig, fmt::format("{}: {}", endpoint_.text, address.error().message));
    }
    address_ = *address;
  }
  std::unique_ptr<modbus_t, ContextDeleter> context(
      endpoint_.is_tcp ? modbus_new_tcp_pi(address_.c_str(), endpoint_.port.c_str())
                       : modbus_new_rtu(endpoint_.device.c_str(), endpoint_.baud, endpoint_.parity,
                                        endpoint_.data_bits, endpoint_.stop_bits));
  if (!context) {
    return fail(ErrorCode::rig, fmt::format("{}: {}", endpoint_.text, modbus_strerror(errno)));
  }
  modbus_set_error_recovery(context.get(), MODBUS_ERROR_RECOVERY_NONE);
  // No limit between two bytes: the response timeout then covers the whole reply.
  modbus_set_byte_timeout(context.get(), 0, 0);
  const milliseconds limit = std::min(response_timeout_, until(deadline));
  modbus_set_response_timeout(context.get(), static_cast<std::uint32_t>(limit.count() / 1000),
                              static_cast<std::uint32_t>(limit.count() % 1000) * 1000 + 1);
  if (modbus_connect(context.get()) == -1) {
    const int error = errno;
    const char* advice = endpoint_.is_tcp
                             ? "is the drive on and connected, are address and port right?"
                             : "is the adapter plugged in, and may this user open it?";
    // libmodbus reports a connection that timed out as "in progress".
    const std::string why =
        error == EINPROGRESS || error == ETIMEDOUT || error == 0
            ? fmt::format("no answer within {:.1f} s", 1e-3 * static_cast<double>(limit.count()))
            : std::string(modbus_strerror(error));
    return fail(ErrorCode::rig,
                fmt::format("{}: cannot connect: {}: {}", endpoint_.text, why, advice));
  }
  context_ = std::move(context);
  return {};
}

void ModbusLink::wait_past_late_reply(SteadyTime deadline) {
  // A closed TCP connection takes its late replies with it; on a serial line they still come.
  if (endpoint_.is_tcp) return;
  if (input_pending(std::min(response_timeout_, until(deadline)))) {
    do {
      modbus_flush(context_.get());
    } while (until(deadline).count() > 0 && input_pending(kQuietLine));
  }
  modbus_flush(context_.get());
}

Result<void> ModbusLink::synchronise(int unit, SteadyTime deadline) {
  assert(probe_.contains(unit));
  // Something that nobody asked for waits at the door (or the other side has closed it).
  if (context_ && input_pending(milliseconds{0})) close();
  if (in_step(unit)) return {};
  // A wrong reply that was met is one fewer on its way: trying again gets past it. Silence is not
  // asked twice, nor is a drive that cannot be connected to.
  Result<void> done = probe_once(unit, deadline);
  for (int repeat = 0; repeat < kProbeRepeats && !done && worth_repeating_; ++repeat) {
    done = probe_once(unit, deadline);
  }
  return done;
}

Result<void> ModbusLink::probe_once(int unit, SteadyTime deadline) {
  worth_repeating_ = false;
  if (auto opened = open(deadline); !opened) return opened;
  std::set<int>& unanswered = unanswered_[unit];
  if (!unanswered.empty()) wait_past_late_reply(deadline);
  const ProbeBlock& block = probe_.at(unit);
  int count = 1;
  while (count <= block.count && unanswered.contains(count)) ++count;
  if (count > block.count) {
    // Every length has been tried in vain, for many response times: the first are long past.
    unanswered.clear();
    count = 1;
  }
  auto words = read_once(unit, block.address, count, deadline);
  if (!words) return fail(words.error());
  unanswered.clear();
  return {};
}

bool ModbusLink::send(std::span<const std::uint8_t> body) {
  if (!endpoint_.is_tcp) {
    return modbus_send_raw_request(context_.get(), body.data(), static_cast<int>(body.size())) > 0;
  }
  // modbus_send_raw_request() always sends transaction 0, and could not tell two replies apart.
  const auto frame = wrap_tcp(++transaction_, body);
  return ::send(modbus_get_socket(context_.get()), frame.data(), frame.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(frame.size());
}

Result<std::vector<std::uint8_t>> ModbusLink::exchange(std::span<const std::uint8_t> body,
                                                       SteadyTime deadline) {
  const int unit = body[0];
  worth_repeating_ = true;
  const milliseconds limit = std::min(response_timeout_, until(deadline));
  if (limit.count() == 0) {
    worth_repeating_ = false;
    return broken(unit, "no time left for another attempt");
  }
  modbus_set_slave(context_.get(), unit);
  modbus_set_response_timeout(context_.get(), static_cast<std::uint32_t>(limit.count() / 1000),
                              static_cast<std::uint32_t>(limit.count() % 1000) * 1000);
  if (!send(body)) return broken(unit, fmt::format("cannot send: {}", modbus_strerror(errno)));

  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> buffer{};
  const int length = modbus_receive_confirmation(context_.get(), buffer.data());
  if (length == -1) {
    if (errno == ETIMEDOUT) {
      worth_repeating_ = false;
      return broken(unit,
                    fmt::format("no reply within {:.1f} s: is the drive on, is the unit id right?",
                                1e-3 * static_cast<double>(limit.count())));
    }
    if (errno == ECONNRESET) return broken(unit, "the drive closed the connection");
    return broken(unit, fmt::format("reply refused: {}", modbus_strerror(errno)));
  }
  const std::span<const std::uint8_t> frame(buffer.data(), static_cast<std::size_t>(length));
  if (endpoint_.is_tcp) {
    const auto inner = unwrap_tcp(frame, transaction_);
    if (!inner) return broken(unit, inner.error().text);
    return std::vector<std::uint8_t>(inner->begin(), inner->end());
  }
  // libmodbus leaves replies of other units unchecked, with length 0.
  if (frame.size() < 5) return broken(unit, "reply from a foreign unit");
  const auto inner = frame.first(frame.size() - 2);  // the checksum has been verified
  return std::vector<std::uint8_t>(inner.begin(), inner.end());
}

Result<std::vector<std::uint16_t>> ModbusLink::read_once(int unit, int address, int count,
                                                         SteadyTime deadline) {
  unanswered_[unit].insert(count);
  const auto reply = exchange(read_request(unit, address, count), deadline);
  if (!reply) return fail(reply.error());
  auto words = parse_read_reply(*reply, unit, count);
  if (!words && words.error().exception == 0) return broken(unit, words.error().text);
  in_step_.insert(unit);
  unanswered_[unit].erase(count);
  if (!words) {
    return fail(ErrorCode::rig,
                fmt::format("{} unit {}: {}", endpoint_.text, unit, words.error().text));
  }
  return std::move(*words);
}

Result<std::vector<std::uint16_t>> ModbusLink::read(int unit, int address, int count,
                                                    SteadyTime deadline) {
  if (auto ready = synchronise(unit, deadline); !ready) return fail(ready.error());
  auto words = read_once(unit, address, count, deadline);
  if (words || in_step(unit)) return words;
  if (!synchronise(unit, deadline)) return words;  // the first reason says more
  return read_once(unit, address, count, deadline);
}

Result<void> ModbusLink::write(int unit, int address, std::span<const std::uint16_t> words,
                               SteadyTime deadline) {
  if (auto ready = synchronise(unit, deadline); !ready) return ready;
  unanswered_[unit].insert(kWriteLength);
  const auto reply = exchange(write_request(unit, address, words), deadline);
  if (!reply) return fail(reply.error());
  const auto done = parse_write_reply(*reply, unit, address, static_cast<int>(words.size()));
  if (!done && done.error().exception == 0) return broken(unit, done.error().text);
  unanswered_[unit].erase(kWriteLength);
  if (done) return {};
  return fail(ErrorCode::rig,
              fmt::format("{} unit {}: {}", endpoint_.text, unit, done.error().text));
}

}  // namespace plumbline::rig
