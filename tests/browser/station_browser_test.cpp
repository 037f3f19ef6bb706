// The station page in a real browser: an operator starts a dry run from the form, pauses it, goes
// on, sees the verdict and opens the certificate.
#include "storage/run_store.h"
#include "tests/app/http_client.h"
#include "tests/browser/station_page.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::browser {
namespace {

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
