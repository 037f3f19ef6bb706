// A station with its database as a process, and a browser that looks at it.
//
// PLUMBLINE_SCREENSHOTS=DIR keeps pictures of the pages.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/app/temp_folder.h"
#include "tests/browser/child.h"
#include "tests/browser/chromium.h"

namespace plumbline::browser {

using app::TempFolder;

/// `plumbline serve` as a process.
class Server {
 public:
  Server(const TempFolder& folder, const std::string& listen,
         const std::vector<std::string>& plans) {
    Pipe out;
    std::vector<std::string> words = {PLUMBLINE_BINARY_DIR "/plumbline",
                                      "serve",
                                      "--db",
                                      folder / "runs.db",
                                      "--listen",
                                      listen,
                                      "--control",
                                      "--golden",
                                      "G-1"};
    words.insert(words.end(), plans.begin(), plans.end());
    child_ = std::make_unique<Child>(words, std::vector<std::pair<int, int>>{{out.write.get(), 1}});
    out.write = End();
    char c = 0;
    while (::read(out.read.get(), &c, 1) == 1 && c != '\n') url_ += c;
    const std::size_t at = url_.find("http://");
    url_ = at == std::string::npos ? "" : url_.substr(at);
  }
  /// "http://127.0.0.1:40123/"
  const std::string& url() const { return url_; }
  std::string address() const { return url_.substr(7, url_.size() - 8); }
  int port() const { return std::stoi(url_.substr(url_.rfind(':') + 1)); }

 private:
  std::unique_ptr<Child> child_;
  std::string url_;
};

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

class StationBrowser : public testing::Test {
 protected:
  void SetUp() override {
    if (chromium_path().empty()) GTEST_SKIP() << "chromium is missing; scripts/setup installs it";
    std::string rig = app::text_of(PLUMBLINE_SOURCE_DIR "/app/examples/rig.toml");
    rig = replaced(rig, "delta_deg = { start = 0, stop = 350, step = 10 }",
                   "delta_deg = { start = 0, stop = 330, step = 30 }");
    rig = replaced(rig, "h_deg = { start = 0, stop = 80, step = 10 }",
                   "h_deg = { start = 0, stop = 80, step = 20 }");
    rig = replaced(rig, "soak_s = 600", "soak_s = 60");
    // A machine that is busy with a browser may be late for a drive that is in a hurry.
    rig = replaced(rig, "watchdog_ms = 3000", "watchdog_ms = 0");
    rig = replaced(rig, "samples_per_pose = 40", "samples_per_pose = 20");
    rig = replaced(rig, "verification_poses = 24", "verification_poses = 6");
    app::write_text(folder_ / "rig.toml", rig);
    start_server("127.0.0.1:0");
    ASSERT_FALSE(server_->url().empty());
    page_ = std::make_unique<Chromium>(chromium_path(), folder_ / "profile");
  }
  void TearDown() override {
    if (page_) {
      EXPECT_EQ(page_->complaints(), "");
    }
  }

  void start_server(const std::string& listen) {
    server_ =
        std::make_unique<Server>(folder_, listen,
                                 std::vector<std::string>{"--simulate", "--simulated-config",
                                                          folder_ / "rig.toml", "--speed", "30"});
  }
  void expect(const std::string& expression, int limit_s = 60) {
    ASSERT_TRUE(page_->wait_for(expression, limit_s)) << expression << "\nthe page shows:\n"
                                                      << page_->value("document.body.innerText");
  }
  /// In light and in dark.
  void keep_picture(const std::string& name) {
    const char* folder = std::getenv("PLUMBLINE_SCREENSHOTS");
    if (folder == nullptr) return;
    for (const bool dark : {false, true}) {
      page_->set_dark(dark);
      std::this_thread::sleep_for(std::chrono::milliseconds(400));
      page_->screenshot(std::string(folder) + "/" + name + (dark ? "-dark.png" : "-light.png"));
    }
    page_->set_dark(false);
  }

  TempFolder folder_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<Chromium> page_;
};

}  // namespace plumbline::browser
