// Nothing sticks out of the station page nor of a certificate on it, on a wide screen and on a
// phone, with names as long as a form allows, twelve effects and an aborted run; and two runs are
// compared.
#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "storage/run_store.h"
#include "tests/app/certificate_example.h"
#include "tests/browser/station_page.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::browser {
namespace {

using nlohmann::json;

const std::string kLongName(60, 'W');

/// What is wider than the box that it stands in, and so lies on something else or is cut off. What
/// may be scrolled (a wide table) is meant to be wider.
constexpr const char* kOverflowing = R"js((() => {
  const found = document.documentElement.scrollWidth > innerWidth ? ["page"] : [];
  for (const e of document.querySelectorAll("body *")) {
    if (e.closest("svg, .sr, .skip, thead, option, select")) continue;
    const style = getComputedStyle(e);
    if (style.overflowX !== "visible" || style.display === "inline" || e.clientWidth === 0) continue;
    if (e.scrollWidth > e.clientWidth + 1) found.push(`${e.tagName} ${e.id} ${e.textContent.slice(0, 40)}`);
  }
  return found;
})())js";

/// A finished or stopped run of three poses; returns the head of its chain.
std::string record(const TempFolder& folder, const std::string& serial, storage::RunState state) {
  auto store = storage::RunStore::open(folder / "runs.db").value();
  storage::RunHeader header = storage::example_header();
  header.serial = serial;
  const auto run = store.create_run(header).value();
  for (long long pose = 0; pose < 3; ++pose) {
    EXPECT_TRUE(store.commit_pose(run, storage::example_pose(pose)));
  }
  EXPECT_TRUE(store.add_event(run, {0.5, "2026-01-02T03:04:06Z", "operator", kLongName}));
  EXPECT_TRUE(store.finish_run(run, state, "2026-01-02T04:00:00Z"));
  return store.runs().value().back().chain_head;
}

void write_result(const TempFolder& folder, const std::string& name, const std::string& chain_head,
                  double Kxx) {
  json effects = json::array();
  app::CertificateExample crowded;
  crowded.add_effects(12);
  crowded.add_not_found();
  crowded.make_names_long();
  for (const FoundEffect& effect : crowded.calibration.diagnosis.effects) {
    effects.push_back({{"id", effect.id}});
  }
  const json axis = {{"K_V_per_g", {Kxx, 0.001, 0.002}},
                     {"U0_V", -2.5},
                     {"u_K_V_per_g", {1e-5, 1e-5, 1e-5}},
                     {"u_U0_V", 2e-5}};
  const json errors = {{"heldout_pose_rms", {0.02, 0.01, 0.03}}};
  const json result = {
      {"provenance", {{"chain_head", chain_head}, {"created_utc", "2026-01-02T05:00:00Z"}}},
      {"decision",
       {{"status", "conditional_pass"},
        {"limit_mps2", 0.2},
        {"max_abs_error_mps2", 0.03},
        {"u_mps2", 0.001}}},
      {"diagnosis", {{"verdict", "partly_explained"}, {"reason", ""}, {"effects", effects}}},
      {"error", {{"before", errors}, {"after", errors}}},
      {"final", {{"batch_ls", {{"x", axis}, {"y", axis}, {"z", axis}}}}}};
  std::filesystem::create_directories(folder / name);
  app::write_text(folder / (name + "/result.json"), result.dump());
  app::write_text(folder / (name + "/certificate.html"), crowded.html());
}

class StationLayout : public StationBrowser {
 protected:
  void expect_tidy(const std::string& what) {
    for (const int width : {1600, 390}) {
      page_->resize(width, 900);
      // On a certificate, which may run no script, the page cannot be asked to wait.
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
      EXPECT_EQ(page_->value(kOverflowing), json::array()) << what << ", " << width << " px wide";
      keep_picture(what + "-" + std::to_string(width));
    }
    page_->resize(1600, 900);
  }
};

TEST_F(StationLayout, LongNamesManyEffectsAndAnAbortedRunFit) {
  write_result(folder_, "one", record(folder_, kLongName, storage::RunState::finished), 0.030);
  write_result(folder_, "two", record(folder_, "A-2", storage::RunState::finished), 0.031);
  page_->go_to(server_->url());
  expect("document.getElementById('verdict')?.textContent === 'CONDITIONAL PASS'");
  expect_tidy("verdict-of-many-effects");

  page_->press("[data-tab=runs]");
  expect("document.querySelectorAll('#runs tbody tr').length === 2");
  page_->press("#search-serial");
  page_->type("WWW");
  expect("document.querySelectorAll('#runs tbody tr').length === 1");
  page_->press("#runs input");
  page_->press("#search-serial");
  page_->value("document.getElementById('search-serial').select()");
  page_->type("-");  // only the other one
  expect("document.querySelector('#runs td[data-name=Unit]')?.textContent === 'A-2'");
  page_->press("#runs input");
  page_->press("#compare");
  expect("document.querySelectorAll('#comparison tbody tr').length === 12");
  expect("document.activeElement.id === 'comparison'");
  EXPECT_EQ(page_->value("[...document.querySelectorAll('#comparison tbody tr:first-child > *')]"
                         ".map(e => e.textContent)"),
            (json{"K_xx / (V/g)", "0.030000 ± 0.000020", "0.031000 ± 0.000020", "0.001000",
                  "35.36  differs"}));
  EXPECT_EQ(page_->value("document.querySelectorAll('#comparison .bad').length"), 3);
  expect_tidy("comparison");

  page_->press("[data-tab=units]");
  expect("document.querySelectorAll('#trends canvas').length === 12");
  expect_tidy("units-of-long-names");
  page_->go_to(server_->url() + "runs/1/certificate.html");
  expect("document.querySelectorAll('figure svg').length > 6");
  expect_tidy("certificate-of-long-names");

  record(folder_, kLongName, storage::RunState::failed);
  page_->go_to(server_->url() + "kiosk");
  expect("document.getElementById('state')?.textContent === 'Failed'");
  expect_tidy("kiosk-aborted");
}

}  // namespace
}  // namespace plumbline::browser
