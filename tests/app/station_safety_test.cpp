// Each attack that the station must bear, tried over a real connection.
#include <sys/stat.h>

#include <chrono>
#include <thread>

#include "tests/app/station_fixture.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

const std::string kPause = R"({"order":"pause"})";
const std::string kControlToken = "c0ntrol-0123456789abcdef";
const std::string kViewToken = "view-only-0123456789abcd";

std::string chunked_stream_request(const std::string& host) {
  return "GET /api/stream HTTP/1.1\r\nHost: " + host + "\r\n\r\n";
}

TEST_F(StationTest, AnswersToItsOwnNamesOnly) {
  open();
  const std::string port_text = ":" + std::to_string(port());
  const auto as = [&](const std::string& host) {
    return exchange(port(),
                    "GET /api/live HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n")
        .status;
  };
  EXPECT_EQ(as("127.0.0.1" + port_text), 200);
  EXPECT_EQ(as("localhost" + port_text), 200);
  EXPECT_EQ(as("evil.example" + port_text), 421) << "a name made to point here";
  EXPECT_EQ(as("127.0.0.1"), 421) << "another port";
  EXPECT_EQ(as("127.0.0.1" + port_text + ".evil.example"), 421);
  EXPECT_EQ(as("127.0.0.1" + port_text + "\r\nHost: evil.example"), 421) << "two of them";
  EXPECT_EQ(exchange(port(), "GET /api/live HTTP/1.1\r\nConnection: close\r\n\r\n").status, 421);
}

TEST_F(StationTest, AnotherSiteReadsNothing) {
  open();
  EXPECT_EQ(get("/api/live", "Origin: http://" + host_ + "\r\n").status, 200);
  EXPECT_EQ(get("/api/live", "Origin: http://evil.example\r\n").status, 403);
  EXPECT_EQ(get("/api/live", "Origin: http://localhost:1\r\n").status, 403);
  EXPECT_EQ(get("/api/live", "Origin: null\r\n").status, 403);
  EXPECT_EQ(get("/api/live", "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\n").status,
            403);
  EXPECT_EQ(get("/", "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\n").status, 200)
      << "a link may lead here";
  const Answer page = get("/");
  EXPECT_THAT(page.head, Not(HasSubstr("Access-Control-Allow-Origin")));
  EXPECT_THAT(page.head, HasSubstr("X-Frame-Options: DENY"));
  EXPECT_THAT(page.head, HasSubstr("script-src 'self'"));
  EXPECT_THAT(page.head, HasSubstr("X-Content-Type-Options: nosniff"));
}

TEST_F(StationTest, ActionsNeedOriginAndToken) {
  open_with_control();
  const std::string good = own_headers();
  // Everything is right, only nothing runs.
  EXPECT_EQ(post("/api/order", good, kPause).status, 409);

  const std::string csrf = good.substr(good.find("X-CSRF"));
  const std::string type = "Content-Type: application/json\r\n";
  const std::string origin = "Origin: http://" + host_ + "\r\n";
  EXPECT_EQ(post("/api/order", type + csrf, kPause).status, 403) << "without Origin";
  EXPECT_EQ(post("/api/order", "Origin: http://evil.example\r\n" + type + csrf, kPause).status,
            403);
  EXPECT_EQ(post("/api/order", "Origin: null\r\n" + type + csrf, kPause).status, 403);
  EXPECT_EQ(post("/api/order", origin + type, kPause).status, 403) << "without token";
  EXPECT_EQ(post("/api/order", origin + type + "X-CSRF-Token: 0000\r\n", kPause).status, 403);
  EXPECT_EQ(post("/api/order", origin + csrf + "Content-Type: text/plain\r\n", kPause).status, 415)
      << "what a form of another site can send";
  EXPECT_EQ(post("/api/order", good + "Referer: http://" + host_ + "/kiosk\r\n", kPause).status,
            403);
  EXPECT_EQ(get("/api/order?order=stop").status, 404) << "no action by a link";
  for (const char* method : {"PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"}) {
    const Answer answer =
        exchange(port(), std::string(method) + " /api/order HTTP/1.1\r\nHost: " + host_ +
                             "\r\nConnection: close\r\n\r\n");
    EXPECT_GE(answer.status, 400) << method;
  }
}

TEST_F(StationTest, TokensOfTwoStationsDiffer) {
  open_with_control();
  const std::string before = own_headers();
  open_with_control();
  EXPECT_EQ(
      post("/api/order",
           "Origin: http://" + host_ + "\r\n" + before.substr(before.find("\r\n") + 2), kPause)
          .status,
      403);
}

TEST_F(StationTest, OnlyShowsUnlessStartedWithControl) {
  open();
  EXPECT_TRUE(json("/api/station")["csrf"].is_null());
  EXPECT_EQ(post("/api/order", own_headers(), kPause).status, 403);
  EXPECT_EQ(post("/api/start", own_headers(), R"({"serial":"A","operator":"B","plan":"C"})").status,
            403);
}

TEST_F(StationTest, KioskHasNothingToPress) {
  open_with_control();
  const std::string page = get("/").body;
  EXPECT_THAT(page, HasSubstr("id=\"stop\""));
  const std::string kiosk = get("/kiosk").body;
  EXPECT_THAT(kiosk, HasSubstr("data-view=\"kiosk\""));
  for (const char* part : {"id=\"stop\"", "id=\"pause\"", "id=\"start\"", "<dialog"}) {
    EXPECT_THAT(kiosk, Not(HasSubstr(part)));
  }
  const Answer station = get("/api/station", "Referer: http://" + host_ + "/kiosk\r\n");
  EXPECT_THAT(station.body, HasSubstr("\"csrf\":null"));
}

TEST_F(StationTest, StartChecksWhatItIsGiven) {
  StationOptions options;
  options.guard.control = true;
  options.launcher.plans = {{.name = "plan", .simulated = true}};
  open(options);
  const std::string headers = own_headers();
  const auto start = [&](const std::string& body) { return post("/api/start", headers, body); };
  EXPECT_EQ(start("{").status, 400);
  EXPECT_EQ(start("[]").status, 400);
  EXPECT_EQ(start(R"({"serial":"","operator":"B","plan":"plan"})").status, 400);
  EXPECT_EQ(start(R"({"serial":"A\u0000\n","operator":"B","plan":"plan"})").status, 400);
  EXPECT_EQ(start(R"({"serial":7,"operator":"B","plan":"plan"})").status, 400);
  EXPECT_EQ(
      start(R"({"serial":")" + std::string(65, 'A') + R"(","operator":"B","plan":"plan"})").status,
      400);
  EXPECT_EQ(start(R"({"serial":"A","operator":"B","plan":"../other.toml"})").status, 409);
  EXPECT_FALSE(fs::exists(folder_ / "A"));
}

TEST_F(StationTest, NoWayOutOfTheFolder) {
  const std::string head = record("A-1");
  const TempFolder elsewhere;
  write_text(elsewhere / "secret.txt", "TOPSECRET");
  // A result that lies elsewhere, reached through a link.
  write_text(elsewhere / "result.json", "{\"provenance\":{\"chain_head\":\"" + head + "\"}}");
  write_text(elsewhere / "certificate.html", "TOPSECRET");
  fs::create_directory(folder_ / "linked");
  fs::create_symlink(elsewhere / "result.json", folder_ / "linked" / "result.json");
  write_text(folder_ / "token.txt", "TOPSECRET");
  open();
  const std::string outside = elsewhere.path().string();
  for (const std::string& target :
       std::vector<std::string>{"/../token.txt",
                                "/runs/1/../token.txt",
                                "/runs/1/..%2ftoken.txt",
                                "/runs/../token.txt",
                                "/runs/1/%2e%2e/%2e%2e/token.txt",
                                "/runs/1/....//token.txt",
                                "/runs/1//etc/passwd",
                                "/runs/1/" + outside + "/secret.txt",
                                "/token.txt",
                                "/runs/1/token.txt",
                                "/runs.db",
                                "/runs/1/certificate.html%00.txt",
                                "/runs/1/certificate.html",
                                "//etc/passwd",
                                "/runs/..%5c..%5ctoken.txt",
                                "/runs/1%2f..%2f..%2ftoken.txt",
                                "/runs/-1/result.json",
                                "/runs/1e0/samples.csv",
                                "/runs/99999999999999999999/samples.csv",
                                "/runs/1",
                                "/station.css/../../token.txt"}) {
    const Answer answer = get(target);
    EXPECT_NE(answer.status, 200) << target;
    EXPECT_THAT(answer.body, Not(HasSubstr("TOPSECRET"))) << target;
    EXPECT_THAT(answer.body, Not(HasSubstr("root:"))) << target;
  }
  EXPECT_EQ(get("/runs/1/samples.csv").status, 200);
}

TEST_F(StationTest, RefusesWhatIsTooLarge) {
  open_with_control();
  const std::string headers = own_headers();
  const auto refused = [](const Answer& answer) {
    return answer.status == 0 || answer.status >= 400;  // hung up, or said why
  };
  EXPECT_TRUE(refused(post("/api/start", headers, std::string(1 << 20, 'x'))));
  EXPECT_TRUE(refused(get("/" + std::string(100000, 'a'))));
  EXPECT_TRUE(refused(get("/", "X-Long: " + std::string(1 << 20, 'a') + "\r\n")));
  EXPECT_TRUE(refused(exchange(port(), std::string(1 << 20, '\0'))));
  EXPECT_TRUE(refused(exchange(port(), "GET / HTTP/9.9\r\n\r\n")));
  EXPECT_TRUE(refused(exchange(port(), "POST /api/start HTTP/1.1\r\nHost: " + host_ +
                                           "\r\nContent-Length: 99999999999\r\n\r\nx")));
  EXPECT_EQ(get("/healthz").status, 200) << "and is as well as before";
}

TEST_F(StationTest, DawdlersDoNotKeepOthersOut) {
  open();
  std::vector<Connection> dawdlers;
  for (int i = 0; i < 10; ++i) {
    dawdlers.emplace_back(port());
    dawdlers.back().send("GET /api/live HTTP/1.1\r\nHo");
  }
  EXPECT_EQ(get("/healthz").status, 200);
}

TEST_F(StationTest, OtherAddressesNeedATokenFile) {
  StationOptions options;
  options.guard.address = {"0.0.0.0", 0};
  const auto refused = Station::start(options);
  ASSERT_FALSE(refused.has_value());
  EXPECT_THAT(refused.error().message, HasSubstr("--token-file"));
}

TEST_F(StationTest, TokenFileIsPrivateAndLong) {
  const fs::path file = folder_ / "tokens";
  write_text(file, "control = " + kControlToken + "\n# shown to visitors\nview = " + kViewToken);
  ::chmod(file.c_str(), 0644);
  EXPECT_FALSE(read_token_file(file).has_value()) << "others can read it";
  ::chmod(file.c_str(), 0600);
  const auto tokens = read_token_file(file);
  ASSERT_TRUE(tokens.has_value()) << tokens.error().message;
  EXPECT_EQ(tokens->control, kControlToken);
  EXPECT_EQ(tokens->view, kViewToken);
  for (const char* text : {"", "control = short", "kontrol = 0123456789abcdef", "control"}) {
    write_text(file, text);
    EXPECT_FALSE(read_token_file(file).has_value()) << text;
  }
}

TEST_F(StationTest, TokensDecideWhoLooksAndWhoActs) {
  StationOptions options;
  options.guard.control = true;
  options.guard.tokens = {kControlToken, kViewToken};
  open(options);
  EXPECT_EQ(get("/api/live").status, 401);
  EXPECT_EQ(get("/").status, 401);
  EXPECT_EQ(get("/metrics").status, 401);
  EXPECT_EQ(get("/runs/1/samples.csv").status, 401);
  EXPECT_THAT(get("/", "Accept: text/html\r\n").body, HasSubstr("asks for a token"));
  EXPECT_EQ(get("/healthz").status, 200) << "says nothing about anything";
  EXPECT_EQ(get("/api/live", "Authorization: Bearer wrong-0123456789abcdef\r\n").status, 401);
  EXPECT_EQ(get("/api/live", "Authorization: Bearer " + kViewToken + "\r\n").status, 200);

  const std::string origin = "Origin: http://" + host_ + "\r\nContent-Type: application/json\r\n";
  EXPECT_EQ(post("/login", origin, R"({"token":"wrong"})").status, 401);
  EXPECT_EQ(post("/login", "Origin: http://evil.example\r\n", "{}").status, 403);
  const auto cookie_of = [&](const std::string& token) {
    const Answer answer = post("/login", origin, R"({"token":")" + token + "\"}");
    EXPECT_EQ(answer.status, 200);
    EXPECT_THAT(answer.head, HasSubstr("HttpOnly; SameSite=Strict"));
    return "Cookie: plumbline_token=" + token + "\r\n";
  };
  const std::string viewer = cookie_of(kViewToken);
  EXPECT_EQ(get("/api/live", viewer).status, 200);
  EXPECT_THAT(get("/api/station", viewer).body, HasSubstr("\"csrf\":null"));
  const std::string controller = cookie_of(kControlToken);
  const auto station = nlohmann::json::parse(get("/api/station", controller).body);
  const std::string csrf = "X-CSRF-Token: " + station["csrf"].get<std::string>() + "\r\n";
  EXPECT_EQ(post("/api/order", origin + csrf + viewer, kPause).status, 403);
  EXPECT_EQ(post("/api/order", origin + csrf, kPause).status, 401);
  EXPECT_EQ(post("/api/order", origin + csrf + controller, kPause).status, 409) << "nothing runs";
}

TEST_F(StationTest, SixteenViewersAndNoMore) {
  open();
  std::vector<Connection> viewers;
  for (int i = 0; i < kMostViewers; ++i) {
    viewers.emplace_back(port());
    viewers.back().send(chunked_stream_request(host_));
    ASSERT_THAT(viewers.back().receive_until("data: "), HasSubstr("text/event-stream")) << i;
  }
  EXPECT_EQ(get("/api/stream").status, 503);
  EXPECT_THAT(get("/metrics").body, HasSubstr("plumbline_viewers 16\n"));
  EXPECT_EQ(get("/api/live").status, 200) << "who comes later asks again and again";
  viewers.clear();
  // They are missed at the next sign of life.
  bool free = false;
  for (int i = 0; i < 300 && !free; ++i) {
    Connection next(port());
    next.send(chunked_stream_request(host_));
    free = next.receive_until("\r\n\r\n").find("503") == std::string::npos;
    if (!free) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  EXPECT_TRUE(free);
}

TEST_F(StationTest, TwoStationsDoNotShareAPort) {
  open();
  StationOptions options;
  options.guard.address.port = port();
  options.history.database = database();
  EXPECT_FALSE(Station::start(options).has_value());
}

}  // namespace
}  // namespace plumbline::app
