#include <arpa/inet.h>
#include <fmt/format.h>
#include <httplib.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <charconv>
#include <chrono>
#include <csignal>
#include <thread>

#include "app/station/http.h"

namespace plumbline::app {

namespace {

/// Every open stream and every connection that is kept alive holds one.
constexpr std::size_t kThreads = 32;
constexpr std::size_t kLongestBody = 16 * 1024;
constexpr int kPatience_s = 5;
/// A browser that is idle must not hold a thread for long.
constexpr int kKeepAlive_s = 1;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

HttpRequest request_of(const httplib::Request& from) {
  HttpRequest request;
  request.method = from.method;
  request.path = from.path;
  for (const auto& [name, value] : from.params) request.query.emplace(name, value);
  for (const auto& [name, value] : from.headers) request.headers.emplace(lower(name), value);
  request.body = from.body;
  return request;
}

void send(HttpReply reply, httplib::Response& to) {
  to.status = reply.status;
  for (const auto& [name, value] : reply.headers) to.set_header(name, value);
  if (!reply.stream && reply.body.empty()) {
    to.set_content("", reply.type);
    return;
  }
  if (!reply.stream) {
    // What the library is given as text it compresses with Brotli at its slowest: seconds of the
    // machine that runs the rig for every look at a certificate, and no gain on a local network.
    const std::size_t size = reply.body.size();
    to.set_content_provider(size, reply.type,
                            [body = std::move(reply.body)](std::size_t offset, std::size_t length,
                                                           httplib::DataSink& sink) {
                              return sink.write(body.data() + offset, length);
                            });
    return;
  }
  to.set_header("Cache-Control", "no-store");
  to.set_header("X-Accel-Buffering", "no");
  to.set_chunked_content_provider("text/event-stream", [stream = std::move(reply.stream)](
                                                           std::size_t, httplib::DataSink& sink) {
    std::string text;
    if (!stream(text)) {
      sink.done();
      return true;
    }
    // A provider that writes nothing never learns that its client has gone.
    if (text.empty()) text = ": alive\n\n";
    return sink.write(text.data(), text.size());
  });
}

}  // namespace

std::string HttpRequest::header(const std::string& name) const {
  const auto [first, last] = headers.equal_range(name);
  if (first == last || std::next(first) != last) return "";
  return first->second;
}

std::string HttpRequest::parameter(const std::string& name) const {
  const auto found = query.find(name);
  return found == query.end() ? "" : found->second;
}

HttpReply HttpReply::text(int status, std::string body) {
  return {.status = status, .body = std::move(body) + "\n", .headers = {}, .stream = {}};
}

HttpReply HttpReply::json(int status, std::string body) {
  return {.status = status,
          .type = "application/json",
          .body = std::move(body),
          .headers = {{"Cache-Control", "no-store"}},
          .stream = {}};
}

bool ListenAddress::is_loopback() const { return host.starts_with("127.") || host == "::1"; }

std::string ListenAddress::text() const {
  return host.find(':') == std::string::npos ? fmt::format("{}:{}", host, port)
                                             : fmt::format("[{}]:{}", host, port);
}

Result<ListenAddress> parse_listen_address(const std::string& text) {
  const auto refuse = [&] {
    return fail(ErrorCode::input,
                fmt::format("{}: not an address to listen on; like 127.0.0.1:8080", text));
  };
  ListenAddress address;
  std::string port;
  if (text.starts_with('[')) {
    const std::size_t end = text.find(']');
    if (end == std::string::npos) return refuse();
    address.host = text.substr(1, end - 1);
    port = text.substr(end + 1);
    if (!port.empty() && port[0] != ':') return refuse();
    if (!port.empty()) port.erase(0, 1);
  } else if (const std::size_t colon = text.find(':'); colon != std::string::npos) {
    address.host = text.substr(0, colon);
    port = text.substr(colon + 1);
  } else if (text.find('.') != std::string::npos) {
    address.host = text;
  } else {
    port = text;
  }
  if (address.host == "localhost") address.host = "127.0.0.1";
  in6_addr binary{};
  if (inet_pton(AF_INET, address.host.c_str(), &binary) != 1 &&
      inet_pton(AF_INET6, address.host.c_str(), &binary) != 1) {
    return refuse();
  }
  if (port.empty()) return address;
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (error != std::errc() || end != port.data() + port.size() || address.port < 0 ||
      address.port > 65535) {
    return refuse();
  }
  return address;
}

struct HttpServer::Library {
  httplib::Server server;
  std::jthread thread;
};

HttpServer::HttpServer(ListenAddress address, std::unique_ptr<Library> library)
    : address_(std::move(address)), library_(std::move(library)) {}

HttpServer::~HttpServer() {
  library_->server.stop();
  library_->thread.join();
}

Result<std::unique_ptr<HttpServer>> HttpServer::start(const ListenAddress& address,
                                                      HttpHandler handler) {
  std::signal(SIGPIPE, SIG_IGN);  // a viewer may leave at any time
  auto library = std::make_unique<Library>();
  httplib::Server& server = library->server;
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_payload_max_length(kLongestBody);
  server.set_read_timeout(kPatience_s);
  server.set_write_timeout(kPatience_s);
  server.set_keep_alive_timeout(kKeepAlive_s);
  server.set_tcp_nodelay(true);
  // The library's own choice, SO_REUSEPORT, would let two stations share one port unnoticed.
  server.set_socket_options([](int socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  const auto handle = [handler = std::move(handler)](const httplib::Request& from,
                                                     httplib::Response& to) {
    send(handler(request_of(from)), to);
  };
  server.Get(".*", handle);
  server.Post(".*", handle);
  server.set_exception_handler(
      [](const httplib::Request& /*request*/, httplib::Response& to, std::exception_ptr /*what*/) {
        to.status = 500;
        to.set_content("internal error\n", "text/plain");
      });
  ListenAddress taken = address;
  if (address.port == 0) {
    taken.port = server.bind_to_any_port(address.host);
  } else if (!server.bind_to_port(address.host, address.port)) {
    taken.port = -1;
  }
  if (taken.port < 0) {
    return fail(
        ErrorCode::input,
        fmt::format("{}: cannot listen there; is another program using the port?", address.text()));
  }
  library->thread = std::jthread([&server] { server.listen_after_bind(); });
  // Before it runs it cannot be stopped.
  while (!server.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return std::unique_ptr<HttpServer>(new HttpServer(taken, std::move(library)));
}

}  // namespace plumbline::app
