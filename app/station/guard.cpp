#include "app/station/guard.h"

#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <stdexcept>

#include "app/io/read_file.h"
#include "app/io/sha256.h"

namespace plumbline::app {

namespace {

constexpr const char* kCookie = "plumbline_token";
constexpr std::size_t kShortestToken = 16;

/// The value of our cookie in a Cookie header.
std::string cookie_in(const std::string& header) {
  std::istringstream parts(header);
  for (std::string part; std::getline(parts, part, ';');) {
    part = trimmed(part);
    const std::string name = std::string(kCookie) + "=";
    if (part.starts_with(name)) return part.substr(name.size());
  }
  return "";
}

}  // namespace

bool equal_secrets(const std::string& a, const std::string& b) {
  // Digests have one length, so that not even that of the secret shows.
  const std::string x = sha256(a);
  const std::string y = sha256(b);
  unsigned difference = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    difference |= static_cast<unsigned char>(x[i]) ^ static_cast<unsigned char>(y[i]);
  }
  return difference == 0;
}

std::string new_secret() {
  std::array<unsigned char, 32> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("the system gives no random numbers");
  }
  std::string text;
  for (const unsigned char byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

Result<AccessTokens> read_token_file(const std::filesystem::path& file) {
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::input, fmt::format("{}: {}", file.string(), why));
  };
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0 && (status.st_mode & 077U) != 0) {
    return refuse("others may read this token file; chmod 600 it");
  }
  const auto text = read_file(file);
  if (!text) return fail(text.error());
  AccessTokens tokens;
  std::istringstream lines(*text);
  for (std::string line; std::getline(lines, line);) {
    line = trimmed(line);
    if (line.empty() || line[0] == '#') continue;
    const std::size_t equals = line.find('=');
    const std::string name = trimmed(line.substr(0, equals));
    if (equals == std::string::npos || (name != "control" && name != "view")) {
      return refuse("a line is `control = TOKEN` or `view = TOKEN`");
    }
    const std::string token = trimmed(line.substr(equals + 1));
    if (token.size() < kShortestToken || token.find_first_of(" ;,\"\t") != std::string::npos) {
      return refuse(
          fmt::format("a token has {} characters or more, without spaces, commas, "
                      "semicolons and quotes",
                      kShortestToken));
    }
    (name == "control" ? tokens.control : tokens.view) = token;
  }
  if (tokens.control.empty() && tokens.view.empty()) return refuse("holds no token");
  return tokens;
}

Guard::Guard(GuardOptions options) : options_(std::move(options)), csrf_(new_secret()) {}

bool Guard::asks_for_token() const {
  return !options_.tokens.control.empty() || !options_.tokens.view.empty();
}

bool Guard::names_us(const std::string& host) const {
  const std::string port = fmt::format(":{}", options_.address.port);
  const auto is = [&](const std::string& name) {
    return host == name + port || (options_.address.port == 80 && host == name);
  };
  if (options_.address.is_loopback() && (is("127.0.0.1") || is("localhost") || is("[::1]"))) {
    return true;
  }
  return host == options_.address.text() ||
         std::any_of(options_.names.begin(), options_.names.end(), is);
}

Guard::Access Guard::access(const HttpRequest& request) const {
  if (!asks_for_token()) return options_.control ? Access::control : Access::view;
  std::string token = cookie_in(request.header("cookie"));
  constexpr std::string_view kBearer = "Bearer ";
  const std::string authorization = request.header("authorization");
  if (authorization.starts_with(kBearer)) token = trimmed(authorization.substr(kBearer.size()));
  if (token.empty()) return Access::none;
  if (!options_.tokens.control.empty() && equal_secrets(token, options_.tokens.control)) {
    return options_.control ? Access::control : Access::view;
  }
  if (!options_.tokens.view.empty() && equal_secrets(token, options_.tokens.view)) {
    return Access::view;
  }
  return Access::none;
}

std::optional<std::string> Guard::cookie_for(const std::string& token) const {
  const bool known =
      (!options_.tokens.control.empty() && equal_secrets(token, options_.tokens.control)) ||
      (!options_.tokens.view.empty() && equal_secrets(token, options_.tokens.view));
  if (!known) return std::nullopt;
  return fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict", kCookie, token);
}

bool Guard::may_control(const HttpRequest& request) const {
  return options_.control && access(request) == Access::control;
}

std::optional<HttpReply> Guard::refuse_action(const HttpRequest& request) const {
  if (!options_.control) {
    return HttpReply::text(403, "this station only shows; it was started without --control");
  }
  if (access(request) != Access::control) return HttpReply::text(403, "this token may only look");
  // Browsers send Origin with every POST; what sends none is no page of ours.
  if (request.header("origin").empty()) return HttpReply::text(403, "without Origin");
  if (request.header("referer").find("/kiosk") != std::string::npos) {
    return HttpReply::text(403, "the kiosk view only shows");
  }
  if (!equal_secrets(request.header("x-csrf-token"), csrf_)) {
    return HttpReply::text(403, "without this session's token; load the page anew");
  }
  if (!request.header("content-type").starts_with("application/json")) {
    return HttpReply::text(415, "an action is JSON");
  }
  return std::nullopt;
}

std::optional<HttpReply> Guard::refuse(const HttpRequest& request) const {
  if (request.method != "GET" && request.method != "HEAD" && request.method != "POST") {
    return HttpReply::text(405, "not a method of this server");
  }
  const std::string host = request.header("host");
  if (!names_us(host)) return HttpReply::text(421, "not a name of this server");
  const std::size_t origins = request.headers.count("origin");
  if (origins > 0 && request.header("origin") != "http://" + host) {
    return HttpReply::text(403, "asked for by another site");
  }
  const std::string site = request.header("sec-fetch-site");
  const bool page = request.header("sec-fetch-mode") == "navigate" && request.method == "GET";
  if (!site.empty() && site != "same-origin" && site != "none" && !page) {
    return HttpReply::text(403, "asked for by another site");
  }
  const bool open = request.path == "/healthz" || request.path == "/login" ||
                    request.path == "/station.css" || request.path == "/login.js";
  if (!open && access(request) == Access::none) {
    HttpReply reply = HttpReply::text(401, "asks for a token");
    reply.headers.emplace_back("WWW-Authenticate", "Bearer");
    return reply;
  }
  if (request.method == "POST" && request.path != "/login") return refuse_action(request);
  return std::nullopt;
}

}  // namespace plumbline::app
