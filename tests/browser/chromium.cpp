#include "tests/browser/chromium.h"

#include <poll.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "tests/browser/child.h"

namespace plumbline::browser {

using nlohmann::json;

namespace {

constexpr int kPatience_ms = 60000;

std::string decoded(const std::string& base64) {
  const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : base64) {
    const std::size_t digit = alphabet.find(c);
    if (digit == std::string::npos) break;
    bits = (bits << 6U) | static_cast<unsigned>(digit);
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes += static_cast<char>((bits >> static_cast<unsigned>(count)) & 0xffU);
    }
  }
  return bytes;
}

}  // namespace

std::string chromium_path() {
  for (const char* path : {"/usr/bin/chromium", "/usr/bin/chromium-browser"}) {
    if (std::filesystem::exists(path)) return path;
  }
  return "";
}

struct Chromium::Process {
  Process(const std::string& path, const std::string& folder)
      // Its ends get numbers that are not those of the child, or dup2 would not clear
      // close-on-exec.
      : orders_high(::fcntl(orders.read.get(), F_DUPFD_CLOEXEC, 20)),
        answers_high(::fcntl(answers.write.get(), F_DUPFD_CLOEXEC, 20)),
        child({path, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
               "--disable-background-networking", "--disable-component-update", "--disable-sync",
               "--disable-extensions", "--no-first-run", "--hide-scrollbars", "--lang=en",
               "--remote-debugging-pipe", "--user-data-dir=" + folder, "--window-size=1280,1000",
               "about:blank"},
              {{orders_high.get(), 3}, {answers_high.get(), 4}}) {
    orders.read = End();
    answers.write = End();
    orders_high = End();
    answers_high = End();
  }
  Pipe orders;
  Pipe answers;
  End orders_high;
  End answers_high;
  Child child;
};

Chromium::Chromium(const std::string& path, const std::string& folder)
    : process_(std::make_unique<Process>(path, folder)) {
  const std::string target =
      call("Target.createTarget", {{"url", "about:blank"}}).at("targetId").get<std::string>();
  session_ = call("Target.attachToTarget", {{"targetId", target}, {"flatten", true}})
                 .at("sessionId")
                 .get<std::string>();
  call("Page.enable");
  call("Runtime.enable");
  resize(1280, 1000);
}

Chromium::~Chromium() { process_->child.end(SIGKILL); }

json Chromium::receive() {
  for (;;) {
    if (const std::size_t end = buffer_.find('\0'); end != std::string::npos) {
      json message = json::parse(buffer_.substr(0, end));
      buffer_.erase(0, end + 1);
      return message;
    }
    pollfd ready{process_->answers.read.get(), POLLIN, 0};
    char bytes[65536];
    const ssize_t length =
        ::poll(&ready, 1, kPatience_ms) > 0 ? ::read(ready.fd, bytes, sizeof bytes) : -1;
    if (length <= 0) throw std::runtime_error("the browser does not answer");
    buffer_.append(bytes, static_cast<std::size_t>(length));
  }
}

json Chromium::call(const std::string& method, const json& parameters) {
  const int id = ++next_id_;
  json order = {{"id", id}, {"method", method}};
  if (!parameters.is_null()) order["params"] = parameters;
  if (!session_.empty()) order["sessionId"] = session_;
  const std::string text = order.dump() + '\0';
  if (::write(process_->orders.write.get(), text.data(), text.size()) !=
      static_cast<ssize_t>(text.size())) {
    throw std::runtime_error("the browser has gone");
  }
  for (;;) {
    const json message = receive();
    if (message.value("method", "") == "Runtime.exceptionThrown") {
      complaints_ += message["params"]["exceptionDetails"].dump() + "\n";
    }
    if (message.value("method", "") == "Runtime.consoleAPICalled" &&
        message["params"]["type"] == "error") {
      complaints_ += message["params"]["args"].dump() + "\n";
    }
    if (message.value("id", 0) != id) continue;
    if (message.contains("error"))
      throw std::runtime_error(method + ": " + message["error"].dump());
    return message["result"];
  }
}

void Chromium::go_to(const std::string& url) { call("Page.navigate", {{"url", url}}); }

void Chromium::reload() { call("Page.reload"); }

json Chromium::value(const std::string& expression) {
  const json result =
      call("Runtime.evaluate",
           {{"expression", expression}, {"returnByValue", true}, {"awaitPromise", true}});
  return result.contains("exceptionDetails") ? json() : result["result"].value("value", json());
}

bool Chromium::wait_for(const std::string& expression, int limit_s) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(limit_s);
  while (std::chrono::steady_clock::now() < end) {
    if (value(expression) == true) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return false;
}

void Chromium::press(const std::string& selector) {
  // What was scrolled is hit where it is drawn, so the next frames are waited for.
  const json at =
      value("(async () => { const e = document.querySelector(" + json(selector).dump() +
            "); e.scrollIntoView({block: 'center', behavior: 'instant'}); "
            "for (let k = 0; k < 3; ++k) await new Promise(done => setTimeout(done, 50)); "
            "const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; "
            "})()");
  if (!at.is_array()) throw std::runtime_error("there is no " + selector);
  for (const char* type : {"mouseMoved", "mousePressed", "mouseReleased"}) {
    call("Input.dispatchMouseEvent",
         {{"type", type}, {"x", at[0]}, {"y", at[1]}, {"button", "left"}, {"clickCount", 1}});
  }
}

void Chromium::type(const std::string& text) {
  for (const char c : text) {
    const bool enter = c == '\n';
    json key = {{"type", "keyDown"},
                {"text", enter ? std::string("\r") : std::string(1, c)},
                {"key", enter ? std::string("Enter") : std::string(1, c)}};
    if (enter) key["windowsVirtualKeyCode"] = 13;
    call("Input.dispatchKeyEvent", key);
    key["type"] = "keyUp";
    key.erase("text");
    call("Input.dispatchKeyEvent", key);
  }
}

void Chromium::set_dark(bool dark) {
  call("Emulation.setEmulatedMedia",
       {{"features", {{{"name", "prefers-color-scheme"}, {"value", dark ? "dark" : "light"}}}}});
}

void Chromium::resize(int width, int height) {
  call("Emulation.setDeviceMetricsOverride",
       {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}});
}

void Chromium::screenshot(const std::string& file) {
  const json picture = call("Page.captureScreenshot", {{"format", "png"}});
  std::ofstream(file, std::ios::binary) << decoded(picture["data"].get<std::string>());
}

}  // namespace plumbline::browser
