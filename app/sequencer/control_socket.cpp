#include "app/sequencer/control_socket.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <utility>
#include <vector>

#include "rig/socket_receive.h"

namespace plumbline::app {

namespace fs = std::filesystem;
using rig::Descriptor;
using std::chrono::milliseconds;

namespace {

constexpr const char* kSuffix = ".ctl";
constexpr std::size_t kMostClients = 32;
constexpr std::size_t kLongestRequest = 4096;
/// A watcher that is so far behind has stopped reading.
constexpr std::size_t kMostUnsent = 1 << 20;
constexpr std::size_t kMostPoses = 1000;
/// Bounds how late the end of the session and a change of state are noticed.
constexpr milliseconds kPollTurn{50};

/// sun_path has 108 bytes. A longer path is gone to by its folder, held open.
struct Address {
  Descriptor folder;
  sockaddr_un name{};
};

Result<Address> address_of(const fs::path& path) {
  Address address;
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  address.folder = Descriptor(::open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (!address.folder) {
    return fail(ErrorCode::output, fmt::format("{}: {}", folder.string(), std::strerror(errno)));
  }
  std::error_code ignored;
  std::string text = fs::absolute(path, ignored).string();
  if (text.size() >= sizeof address.name.sun_path) {
    text = fmt::format("/proc/self/fd/{}/{}", address.folder.get(), path.filename().string());
  }
  address.name.sun_family = AF_UNIX;
  if (text.size() >= sizeof address.name.sun_path) {
    return fail(ErrorCode::output,
                fmt::format("{}: the name is too long for a socket", path.string()));
  }
  std::memcpy(address.name.sun_path, text.c_str(), text.size() + 1);
  return address;
}

Descriptor new_socket() {
  return Descriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

const sockaddr* generic(const Address& address) {
  return reinterpret_cast<const sockaddr*>(&address.name);
}

bool connects(const Descriptor& socket, const Address& address) {
  return ::connect(socket.get(), generic(address), sizeof address.name) == 0;
}

Json failure(const std::string& why) { return {{"ok", false}, {"error", why}}; }

std::string line_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

struct Client {
  Descriptor socket;
  std::string in;
  std::string out;
  milliseconds watch_interval{0};  ///< 0: does not watch
  std::uint64_t seen_version = 0;
  std::chrono::steady_clock::time_point next_status;
  bool gone = false;
};

}  // namespace

std::vector<fs::path> running_sessions() {
  std::vector<fs::path> found;
  std::ifstream table("/proc/net/unix");
  for (std::string line; std::getline(table, line);) {
    const std::size_t slash = line.find('/');
    if (slash == std::string::npos || !line.ends_with(kSuffix)) continue;
    const fs::path path = line.substr(slash);
    if (std::find(found.begin(), found.end(), path) != found.end()) continue;
    const auto address = address_of(path);
    if (address && connects(new_socket(), *address)) found.push_back(path);
  }
  return found;
}

fs::path control_path(const fs::path& database) { return database.string() + kSuffix; }

struct ControlSocket::Server {
  Server(const LiveState& live_state, EngineControl& engine_control)
      : state(live_state), control(engine_control) {}

  Json answer(const std::string& line, Client& client) const;
  void read_from(Client& client) const;
  void write_to(Client& client) const;
  void feed_watcher(Client& client) const;
  void run(const std::stop_token& stop);
  Json status() const { return status_json(state.snapshot(), control); }

  const LiveState& state;
  EngineControl& control;
  Descriptor listener;
  std::vector<Client> clients;
  std::jthread thread;
};

Json ControlSocket::Server::answer(const std::string& line, Client& client) const {
  const Json request = Json::parse(line, nullptr, false);
  if (!request.is_object() || !request.contains("command") || !request["command"].is_string()) {
    return failure("a request is an object with a command");
  }
  const std::string command = request["command"];
  if (command == "status") return {{"ok", true}, {"status", status()}};
  if (command == "pause") {
    const std::string at = request.value("at", Json("now")) == Json("pose") ? "pose" : "now";
    if (request.contains("at") && request["at"] != Json(at)) return failure("at is now or pose");
    control.request_pause(at == "pose" ? EngineControl::Pause::at_pose : EngineControl::Pause::now);
  } else if (command == "resume") {
    control.request_resume();
  } else if (command == "stop") {
    control.request_stop();
  } else if (command == "abort") {
    control.request_abort();
  } else if (command == "poses") {
    const Json first = request.value("first", Json(0));
    if (!first.is_number_unsigned()) return failure("first is a number from 0");
    const auto index = first.get<std::size_t>();
    Json list = Json::array();
    for (const PoseMean& pose : state.poses(index, kMostPoses)) list.push_back(pose_json(pose));
    return {{"ok", true}, {"first", index}, {"total", state.snapshot().poses}, {"poses", list}};
  } else if (command == "watch") {
    const Json interval = request.value("interval_ms", Json(250));
    if (!interval.is_number_unsigned() || interval > 10000 || interval < 100) {
      return failure("interval_ms is 100 to 10000");
    }
    client.watch_interval = milliseconds(interval.get<int>());
    client.next_status = {};
  } else {
    return failure(fmt::format("there is no command {}", command));
  }
  return {{"ok", true}};
}

void ControlSocket::Server::read_from(Client& client) const {
  std::array<char, 4096> buffer{};
  const ssize_t length = ::recv(client.socket.get(), buffer.data(), buffer.size(), 0);
  if (length <= 0) {
    client.gone = length == 0 || (errno != EAGAIN && errno != EINTR);
    return;
  }
  client.in.append(buffer.data(), static_cast<std::size_t>(length));
  std::size_t end = 0;
  while ((end = client.in.find('\n')) != std::string::npos) {
    const std::string line = client.in.substr(0, end);
    client.in.erase(0, end + 1);
    if (!line.empty()) client.out += line_of(answer(line, client));
  }
  client.gone = client.in.size() > kLongestRequest;
}

void ControlSocket::Server::write_to(Client& client) const {
  while (!client.out.empty()) {
    const ssize_t sent =
        ::send(client.socket.get(), client.out.data(), client.out.size(), MSG_NOSIGNAL);
    if (sent < 0) {
      client.gone = client.gone || (errno != EAGAIN && errno != EINTR);
      break;
    }
    client.out.erase(0, static_cast<std::size_t>(sent));
  }
  client.gone = client.gone || client.out.size() > kMostUnsent;
}

void ControlSocket::Server::feed_watcher(Client& client) const {
  if (client.watch_interval.count() == 0) return;
  const auto now = std::chrono::steady_clock::now();
  const std::uint64_t version = state.version();
  if (version == client.seen_version && now < client.next_status) return;
  client.seen_version = version;
  client.next_status = now + client.watch_interval;
  client.out += line_of({{"status", status()}});
}

void ControlSocket::Server::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::vector<pollfd> ready = {{listener.get(), POLLIN, 0}};
    for (const Client& client : clients) {
      const auto events = static_cast<short>(client.out.empty() ? POLLIN : POLLIN | POLLOUT);
      ready.push_back({client.socket.get(), events, 0});
    }
    ::poll(ready.data(), ready.size(), static_cast<int>(kPollTurn.count()));
    for (std::size_t i = 0; i < clients.size(); ++i) {
      if (ready[i + 1].revents != 0) read_from(clients[i]);
      feed_watcher(clients[i]);
      write_to(clients[i]);
    }
    std::erase_if(clients, [](const Client& client) { return client.gone; });
    if (ready[0].revents == 0) continue;
    Descriptor accepted(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (accepted && clients.size() < kMostClients) {
      clients.emplace_back().socket = std::move(accepted);
    }
  }
  // Watchers see how it ended.
  for (Client& client : clients) {
    client.seen_version = 0;
    client.next_status = {};
    feed_watcher(client);
    write_to(client);
  }
}

ControlSocket::ControlSocket(fs::path path, std::unique_ptr<Server> server)
    : path_(std::move(path)), server_(std::move(server)) {
  server_->thread =
      std::jthread([raw = server_.get()](const std::stop_token& stop) { raw->run(stop); });
}

ControlSocket::~ControlSocket() {
  server_->thread.request_stop();
  server_->thread.join();
  std::error_code ignored;
  fs::remove(path_, ignored);
}

Result<std::unique_ptr<ControlSocket>> ControlSocket::open(const fs::path& path,
                                                           const LiveState& state,
                                                           EngineControl& control) {
  auto address = address_of(path);
  if (!address) return fail(address.error());
  if (connects(new_socket(), *address)) {
    return fail(ErrorCode::input,
                fmt::format("{}: another session is running on this database; `plumbline ctl "
                            "status` shows it",
                            path.string()));
  }
  // Left behind by a session that died. An ordinary file refuses connections, too.
  if (errno == ECONNREFUSED && fs::is_socket(path)) ::unlink(path.c_str());
  auto server = std::make_unique<Server>(state, control);
  server->listener = new_socket();
  const mode_t before = ::umask(0177);
  const int bound = ::bind(server->listener.get(), generic(*address), sizeof address->name);
  const int error = errno;
  ::umask(before);
  if (bound != 0 || ::listen(server->listener.get(), 16) != 0) {
    return fail(ErrorCode::output, fmt::format("{}: the control socket cannot be made ({})",
                                               path.string(), std::strerror(error)));
  }
  return std::unique_ptr<ControlSocket>(new ControlSocket(path, std::move(server)));
}

// --- the other end -------------------------------------------------------------------------------

Result<ControlClient> ControlClient::connect(const fs::path& path) {
  const auto nobody = [&](const char* why) {
    return fail(ErrorCode::input,
                fmt::format("{}: no session is running there ({})", path.string(), why));
  };
  const auto address = address_of(path);
  if (!address) return nobody("no such folder");
  Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!connects(socket, *address)) return nobody(std::strerror(errno));
  return ControlClient(::fcntl(socket.get(), F_DUPFD_CLOEXEC, 0));
}

ControlClient::ControlClient(ControlClient&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), buffer_(std::move(other.buffer_)) {}

ControlClient::~ControlClient() {
  if (fd_ >= 0) ::close(fd_);
}

Result<void> ControlClient::send(const Json& request) {
  const std::string line = line_of(request);
  if (::send(fd_, line.data(), line.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(line.size())) {
    return {};
  }
  return fail(ErrorCode::rig, fmt::format("the session has ended ({})", std::strerror(errno)));
}

Result<Json> ControlClient::receive(double timeout_s) {
  for (;;) {
    if (const std::size_t end = buffer_.find('\n'); end != std::string::npos) {
      Json json = Json::parse(buffer_.substr(0, end), nullptr, false);
      buffer_.erase(0, end + 1);
      return json;
    }
    pollfd ready{fd_, POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(std::lround(1000 * timeout_s))) == 0) {
      return fail(ErrorCode::rig, "the session does not answer");
    }
    std::array<char, 65536> bytes{};
    const ssize_t length = ::recv(fd_, bytes.data(), bytes.size(), 0);
    if (length < 0 && errno == EINTR) continue;
    if (length <= 0) return fail(ErrorCode::rig, "the session has ended");
    buffer_.append(bytes.data(), static_cast<std::size_t>(length));
  }
}

Result<Json> ControlClient::ask(const Json& request, double timeout_s) {
  if (auto sent = send(request); !sent) return fail(sent.error());
  return receive(timeout_s);
}

}  // namespace plumbline::app
