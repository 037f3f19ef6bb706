// HTTP as the station uses it: plain requests and replies. The library behind it is seen in
// http_server.cpp only.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

struct HttpRequest {
  std::string method;  ///< "GET", "POST" …
  std::string path;    ///< decoded, without the query
  std::map<std::string, std::string> query;
  std::multimap<std::string, std::string> headers;  ///< names in lower case
  std::string body;

  /// The header's value; empty when it is absent or stands there more than once.
  std::string header(const std::string& name) const;
  /// Empty when absent.
  std::string parameter(const std::string& name) const;
};

/// Called again and again on a thread of its own until it returns false; an empty text is a sign of
/// life. May take up to some seconds.
using EventStream = std::function<bool(std::string& text)>;

struct HttpReply {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  EventStream stream;  ///< when set, sent as text/event-stream instead of `body`

  static HttpReply text(int status, std::string body);
  static HttpReply json(int status, std::string body);
};

using HttpHandler = std::function<HttpReply(const HttpRequest&)>;

/// "127.0.0.1:8080", "[::1]:0"
struct ListenAddress {
  std::string host = "127.0.0.1";
  int port = 8080;  ///< 0: a free one

  bool is_loopback() const;
  std::string text() const;
};
/// Takes "HOST:PORT", "PORT" and "HOST"; a host is a number, not a name.
Result<ListenAddress> parse_listen_address(const std::string& text);

/// Serves on threads of its own until destroyed: requests of at most 16 kB, 8 kB a header line.
class HttpServer {
 public:
  /// ErrorCode::input when the address cannot be had.
  static Result<std::unique_ptr<HttpServer>> start(const ListenAddress& address,
                                                   HttpHandler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  const ListenAddress& address() const { return address_; }  ///< with the port that was taken

 private:
  struct Library;
  HttpServer(ListenAddress address, std::unique_ptr<Library> library);

  ListenAddress address_;
  std::unique_ptr<Library> library_;
};

/// Without blanks, tabs and carriage returns at both ends.
inline std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

}  // namespace plumbline::app
