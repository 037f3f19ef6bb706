// Who may ask the station for what. Decisions only; no sockets.
//
// A page elsewhere on the web can make this machine's browser send requests here. Against that:
// a request must name this server in Host (a name that was made to point here does not), its
// Origin must be this server, and an action must carry a token that only our own page can read.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/station/http.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// What a token file holds; empty text: there is no such token.
struct AccessTokens {
  std::string control;  ///< may do what the station allows
  std::string view;     ///< may look only
};
/// A file that others can read, or tokens shorter than 16 characters, are refused (input). Lines
/// `control = TOKEN` and `view = TOKEN`.
Result<AccessTokens> read_token_file(const std::filesystem::path& file);

struct GuardOptions {
  ListenAddress address;           ///< as bound
  std::vector<std::string> names;  ///< further host names this server is reached by
  AccessTokens tokens;             ///< none: everybody who reaches the address may look
  bool control = false;            ///< actions are allowed at all
};

class Guard {
 public:
  explicit Guard(GuardOptions options);

  /// The refusal, or nothing when the request may go on. A request without access gets 401.
  std::optional<HttpReply> refuse(const HttpRequest& request) const;
  /// Whether this request could be followed by actions: the page then carries csrf().
  bool may_control(const HttpRequest& request) const;
  const std::string& csrf() const { return csrf_; }
  /// Whether the station has tokens at all.
  bool asks_for_token() const;
  /// The cookie that a browser keeps after the right token was typed; nothing when it was wrong.
  std::optional<std::string> cookie_for(const std::string& token) const;

 private:
  enum class Access { none, view, control };
  Access access(const HttpRequest& request) const;
  bool names_us(const std::string& host) const;
  std::optional<HttpReply> refuse_action(const HttpRequest& request) const;

  GuardOptions options_;
  std::string csrf_;
};

/// Takes equally long wherever the texts differ.
bool equal_secrets(const std::string& a, const std::string& b);
/// 32 random bytes as hexadecimal digits.
std::string new_secret();

}  // namespace plumbline::app
