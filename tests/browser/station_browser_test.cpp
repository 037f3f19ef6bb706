// The station page in a real browser: an operator starts a dry run from the form, pauses it, goes
// on, sees the verdict and opens the certificate.
//
// PLUMBLINE_SCREENSHOTS=DIR keeps pictures of the pages.
#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>

#include "storage/run_store.h"
#include "tests/app/http_client.h"
#include "tests/app/temp_folder.h"
#include "tests/browser/child.h"
#include "tests/browser/chromium.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::browser {
namespace {

using app::TempFolder;
using app::text_of;
using app::write_text;

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

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

class StationBrowser : public testing::Test {
 protected:
  void SetUp() override {
    if (chromium_path().empty()) GTEST_SKIP() << "chromium is missing; scripts/setup installs it";
    std::string rig = text_of(PLUMBLINE_SOURCE_DIR "/app/examples/rig.toml");
    rig = replaced(rig, "delta_deg = { start = 0, stop = 350, step = 10 }",
                   "delta_deg = { start = 0, stop = 330, step = 30 }");
    rig = replaced(rig, "h_deg = { start = 0, stop = 80, step = 10 }",
                   "h_deg = { start = 0, stop = 80, step = 20 }");
    rig = replaced(rig, "soak_s = 600", "soak_s = 60");
    // A machine that is busy with a browser may be late for a drive that is in a hurry.
    rig = replaced(rig, "watchdog_ms = 3000", "watchdog_ms = 0");
    rig = replaced(rig, "samples_per_pose = 40", "samples_per_pose = 20");
    rig = replaced(rig, "verification_poses = 24", "verification_poses = 6");
    write_text(folder_ / "rig.toml", rig);
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
      page_->value("new Promise(done => setTimeout(done, 400))");
      page_->screenshot(std::string(folder) + "/" + name + (dark ? "-dark.png" : "-light.png"));
    }
    page_->set_dark(false);
  }

  TempFolder folder_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<Chromium> page_;
};

TEST_F(StationBrowser, OperatorMeasuresAUnit) {
  page_->go_to(server_->url());
  expect("document.getElementById('state')?.textContent === 'Ready'");
  expect("document.activeElement?.id === 'start-serial'");
  keep_picture("ready");
  page_->type("A-0017\n");  // as a scanner does
  expect("document.activeElement?.id === 'start-operator'");
  page_->type("R. Roe\n");
  expect("document.body.dataset.phase === 'running'");
  expect("!document.getElementById('orders').hidden && document.getElementById('start').hidden");
  // The first ring of twelve poses does not determine the axis that it turns about.
  expect("parseInt(document.getElementById('done').textContent) >= 20");
  keep_picture("running");
  // Fifteen more look on to the end; the run below is none the worse for it.
  std::vector<app::Connection> viewers;
  for (int i = 0; i < 15; ++i) {
    viewers.emplace_back(server_->port(), 60);
    viewers.back().send("GET /api/stream HTTP/1.1\r\nHost: " + server_->address() + "\r\n\r\n");
  }

  page_->press("#pause");
  expect("document.getElementById('state').textContent === 'Paused'");
  page_->reload();  // loses nothing
  expect("document.getElementById('state')?.textContent === 'Paused'");
  expect("document.getElementById('serial').textContent === 'A-0017'");
  expect("document.getElementById('events').textContent.includes('R. Roe')");
  expect("document.querySelector('#estimate td').textContent.includes('±')");
  keep_picture("paused");
  page_->press("#stop");
  expect("document.getElementById('confirm-stop').open");
  page_->press("#confirm-stop button[value=no]");  // asked before it is done
  expect("!document.getElementById('confirm-stop').open");
  page_->press("#resume");
  expect("document.getElementById('state').textContent !== 'Paused'");

  expect("!document.getElementById('verdict').hidden", 120);
  EXPECT_EQ(page_->value("document.getElementById('verdict').textContent"), "PASS");
  EXPECT_EQ(page_->value("document.getElementById('state').textContent"), "Finished");
  expect("!document.getElementById('start').hidden");
  keep_picture("verdict");
  for (app::Connection& viewer : viewers) {
    EXPECT_NE(viewer.receive_until("\"decision\":\"pass\"").find("\"decision\":\"pass\""),
              std::string::npos);
  }
  viewers.clear();
  const auto run = page_->value("fetch('/api/runs').then(r => r.json()).then(all => all.runs[0])");
  EXPECT_GE(run["poses"], 60);  // all, unless the machine was so slow that some were left out
  EXPECT_EQ(run["state"], "finished");

  // A server that is started anew is found again, and remembers.
  const std::string address = server_->address();
  server_.reset();
  expect("document.body.dataset.link === 'down'");
  start_server(address);
  ASSERT_EQ(server_->address(), address);
  expect("document.body.dataset.link === 'up'");
  EXPECT_EQ(page_->value("document.getElementById('verdict').textContent"), "PASS");

  page_->press("[data-tab=units]");
  expect("document.querySelectorAll('#trends canvas').length === 12");
  keep_picture("units");
  page_->press("[data-tab=runs]");
  expect("document.querySelectorAll('#runs tbody tr').length === 1");
  keep_picture("runs");
  page_->press("#runs a[href$='certificate.html']");
  expect("document.body.innerText.includes('A-0017') && document.title !== 'plumbline'");
  expect("document.body.innerText.includes('R. Roe')");

  page_->go_to(server_->url() + "kiosk");
  expect("document.getElementById('verdict')?.textContent === 'PASS'");
  EXPECT_EQ(page_->value("document.querySelectorAll('form, input, dialog, nav').length"), 0);
  EXPECT_TRUE(page_->value("document.getElementById('stop') === null").get<bool>());
  keep_picture("kiosk");
}

// A run that was interrupted is gone on with from the page; why it could not be is told (there is
// no rig here).
TEST_F(StationBrowser, OperatorGoesOnWithAnUnfinishedRun) {
  {
    auto store = storage::RunStore::open(folder_ / "runs.db").value();
    storage::RunHeader header = storage::example_header();
    header.serial = "A-9";
    const auto run = store.create_run(header).value();
    ASSERT_TRUE(store.commit_pose(run, storage::example_pose(0)));
  }
  server_ = std::make_unique<Server>(folder_, "127.0.0.1:0",
                                     std::vector<std::string>{"--config", folder_ / "rig.toml"});
  page_->go_to(server_->url());
  expect("document.getElementById('state')?.textContent === 'Interrupted'");
  expect("document.getElementById('go-on').textContent === 'Go on with run 1 of A-9'");
  keep_picture("interrupted");
  page_->press("#go-on");
  expect("document.activeElement.id === 'start-operator'");
  page_->type("R. Roe");
  page_->press("#start-golden");
  expect("document.getElementById('start-serial').value === 'G-1'");
  page_->press("#go-on");
  expect(
      "document.getElementById('start-answer').textContent.includes('The last start ended: "
      "plumbline')");
}

}  // namespace
}  // namespace plumbline::browser
