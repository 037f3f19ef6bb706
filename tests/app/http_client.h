// A client that sends exactly what it is given: requests that no library would let one send.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <string>
#include <string_view>
#include <utility>

namespace plumbline::app {

class Connection {
 public:
  explicit Connection(int port, int timeout_s = 20) : fd_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval limit{timeout_s, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    open_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  Connection(Connection&& other) noexcept
      : fd_(std::exchange(other.fd_, -1)), open_(other.open_), got_(std::move(other.got_)) {}
  Connection& operator=(Connection&&) = delete;
  ~Connection() {
    if (fd_ >= 0) ::close(fd_);
  }

  bool open() const { return open_; }
  /// False when the other end has hung up.
  bool send(std::string_view text) {
    while (!text.empty()) {
      const ssize_t sent = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  /// Everything received so far once it contains `mark`, or all there is at the end.
  const std::string& receive_until(std::string_view mark) {
    char buffer[65536];
    while (got_.find(mark) == std::string::npos) {
      const ssize_t length = ::recv(fd_, buffer, sizeof buffer, 0);
      if (length <= 0) break;
      got_.append(buffer, static_cast<std::size_t>(length));
    }
    return got_;
  }
  const std::string& receive_all() { return receive_until(std::string_view("\0never sent\0", 12)); }

 private:
  int fd_;
  bool open_ = false;
  std::string got_;
};

struct Answer {
  int status = 0;  ///< 0: hung up without a word
  std::string head;
  std::string body;
};

inline Answer answer_of(const std::string& text) {
  Answer answer;
  const std::size_t end = text.find("\r\n\r\n");
  answer.head = text.substr(0, end);
  if (end != std::string::npos) answer.body = text.substr(end + 4);
  if (answer.head.starts_with("HTTP/1.1 ")) answer.status = std::stoi(answer.head.substr(9, 3));
  return answer;
}

/// One request, word for word.
inline Answer exchange(int port, const std::string& request) {
  Connection connection(port);
  connection.send(request);
  return answer_of(connection.receive_all());
}

}  // namespace plumbline::app
