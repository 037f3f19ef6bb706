// A station over a real database and a real port.
#pragma once

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <string>

#include "app/station/station.h"
#include "tests/app/http_client.h"
#include "tests/app/temp_folder.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::app {

class StationTest : public testing::Test {
 protected:
  std::filesystem::path database() const { return folder_ / "runs.db"; }

  /// One finished run of three poses; returns its chain head.
  std::string record(const std::string& serial) {
    auto store = storage::RunStore::open(database()).value();
    storage::RunHeader header = storage::example_header();
    header.serial = serial;
    const storage::RunId run = store.create_run(header).value();
    for (long long pose = 0; pose < 3; ++pose) {
      EXPECT_TRUE(store.commit_pose(run, storage::example_pose(pose)));
    }
    EXPECT_TRUE(store.add_event(run, {0.5, "2026-01-02T03:04:06Z", "operator", "R. Roe"}));
    EXPECT_TRUE(store.finish_run(run, storage::RunState::finished, "2026-01-02T04:00:00Z"));
    return store.runs().value().back().chain_head;
  }

  void open(StationOptions options = {}) {
    options.guard.address.port = 0;
    options.history.database = database();
    if (options.history.results.empty()) options.history.results = folder_.path();
    options.launcher.database = database();
    options.launcher.results = folder_.path();
    auto station = Station::start(options);
    ASSERT_TRUE(station.has_value()) << station.error().message;
    station_ = *std::move(station);
    host_ = "127.0.0.1:" + std::to_string(port());
  }
  void open_with_control() {
    StationOptions options;
    options.guard.control = true;
    open(options);
  }

  int port() const { return station_->address().port; }
  Answer get(const std::string& target, const std::string& headers = "") const {
    return exchange(port(), "GET " + target + " HTTP/1.1\r\nHost: " + host_ + "\r\n" + headers +
                                "Connection: close\r\n\r\n");
  }
  Answer post(const std::string& target, const std::string& headers,
              const std::string& body) const {
    return exchange(port(), "POST " + target + " HTTP/1.1\r\nHost: " + host_ + "\r\n" + headers +
                                "Content-Length: " + std::to_string(body.size()) +
                                "\r\nConnection: close\r\n\r\n" + body);
  }
  nlohmann::json json(const std::string& target) const {
    const Answer answer = get(target);
    EXPECT_EQ(answer.status, 200) << target << answer.body;
    return nlohmann::json::parse(answer.body, nullptr, false);
  }
  /// What our own page sends with an action.
  std::string own_headers() const {
    const auto csrf = json("/api/station")["csrf"];
    return "Origin: http://" + host_ + "\r\nContent-Type: application/json\r\nX-CSRF-Token: " +
           (csrf.is_string() ? csrf.get<std::string>() : "") + "\r\n";
  }

  TempFolder folder_;
  std::string host_;
  std::unique_ptr<Station> station_;
};

}  // namespace plumbline::app
