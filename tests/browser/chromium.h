// A real browser, headless, driven over the DevTools protocol on a pipe: what is pressed and typed
// goes the way of real input events.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

namespace plumbline::browser {

/// Path of Debian's browser, or empty.
std::string chromium_path();

class Chromium {
 public:
  /// `folder` receives its profile.
  Chromium(const std::string& path, const std::string& folder);
  ~Chromium();
  Chromium(const Chromium&) = delete;
  Chromium& operator=(const Chromium&) = delete;

  void go_to(const std::string& url);
  void reload();
  /// Value of a JavaScript expression in the page; null when it throws.
  nlohmann::json value(const std::string& expression);
  /// Waits until the expression is true; says what the page shows when it never is.
  bool wait_for(const std::string& expression, int limit_s = 60);
  /// Presses the middle of the first element that matches.
  void press(const std::string& selector);
  /// Keys one after the other, as a keyboard or a scanner sends them; '\n' is Enter.
  void type(const std::string& text);
  void set_dark(bool dark);
  void resize(int width, int height);
  void screenshot(const std::string& file);
  /// Everything that the page wrote to the console as an error, and uncaught exceptions.
  const std::string& complaints() const { return complaints_; }

 private:
  nlohmann::json call(const std::string& method, const nlohmann::json& parameters = nullptr);
  nlohmann::json receive();

  struct Process;
  std::unique_ptr<Process> process_;
  std::string session_;
  std::string buffer_;
  std::string complaints_;
  int next_id_ = 0;
};

}  // namespace plumbline::browser
