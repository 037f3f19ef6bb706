#include "app/station/station.h"

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <charconv>
#include <chrono>
#include <thread>

#include "app/io/csv_writer.h"
#include "app/io/read_file.h"
#include "app/provenance.h"
#include "app/sequencer/control_socket.h"
#include "app/station/live_feed.h"
#include "app/station/metrics.h"

extern const char kStationPage[];
extern const char kStationLogin[];
extern const char kStationLoginScript[];
extern const char kStationStyle[];
extern const char kStationApp[];
extern const char kStationCommon[];
extern const char kStationLive[];
extern const char kStationHistory[];
extern const char kStationChart[];
extern const char kStationControl[];

namespace plumbline::app {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

namespace {

/// A connection whose other end has gone is noticed when something is written to it.
constexpr milliseconds kHeartbeat{3000};
/// How long an open stream may delay the end of the server.
constexpr milliseconds kTurn{200};
/// A run that is over waits so long at most for its viewers to hear of it.
constexpr milliseconds kFarewell{5000};
constexpr std::size_t kMostRuns = 200;

struct Asset {
  const char* path;
  const char* type;
  const char* text;
};
constexpr std::array kAssets = {
    Asset{"/station.css", "text/css; charset=utf-8", kStationStyle},
    Asset{"/app.js", "text/javascript; charset=utf-8", kStationApp},
    Asset{"/common.js", "text/javascript; charset=utf-8", kStationCommon},
    Asset{"/live.js", "text/javascript; charset=utf-8", kStationLive},
    Asset{"/history.js", "text/javascript; charset=utf-8", kStationHistory},
    Asset{"/chart.js", "text/javascript; charset=utf-8", kStationChart},
    Asset{"/control.js", "text/javascript; charset=utf-8", kStationControl},
    Asset{"/login.js", "text/javascript; charset=utf-8", kStationLoginScript}};

struct Download {
  const char* name;
  const char* type;
};
constexpr std::array kResultFiles = {
    Download{"certificate.html", "text/html; charset=utf-8"},
    Download{"certificate.pdf", "application/pdf"}, Download{"certificate.xml", "application/xml"},
    Download{"result.json", "application/json"}, Download{"evaluation.json", "application/json"}};

std::optional<long long> integer(const std::string& text) {
  long long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || text.empty()) return {};
  return value;
}

std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

HttpReply refusal(int status, const std::string& why) {
  return HttpReply::json(status, dump({{"ok", false}, {"error", why}}));
}

HttpReply reply_of(const Result<Json>& json, int status_of_failure) {
  if (!json) return refusal(status_of_failure, json.error().message);
  return HttpReply::json(200, dump(*json));
}

/// The page, or the part of it that only shows.
std::string page(bool kiosk) {
  std::string text = kStationPage;
  if (!kiosk) return text;
  constexpr std::string_view kBegin = "<!--control-->";
  constexpr std::string_view kEnd = "<!--/control-->";
  for (std::size_t begin = 0; (begin = text.find(kBegin)) != std::string::npos;) {
    const std::size_t end = text.find(kEnd, begin);
    text.erase(begin, end == std::string::npos ? end : end + kEnd.size() - begin);
  }
  constexpr std::string_view kView = "data-view=\"station\"";
  text.replace(text.find(kView), kView.size(), "data-view=\"kiosk\"");
  return text;
}

/// A folder for a file that is made only to be sent.
class Scratch {
 public:
  Scratch() {
    std::string pattern = (fs::temp_directory_path() / "plumbline-station-XXXXXX").string();
    if (::mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  ~Scratch() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  fs::path operator/(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// Headers that keep a reply from being framed, sniffed, or from running anything not ours.
void harden(HttpReply& reply, bool is_certificate) {
  reply.headers.emplace_back("X-Content-Type-Options", "nosniff");
  reply.headers.emplace_back("Referrer-Policy", "same-origin");
  reply.headers.emplace_back("Cross-Origin-Resource-Policy", "same-origin");
  reply.headers.emplace_back("X-Frame-Options", "DENY");
  reply.headers.emplace_back(
      "Content-Security-Policy",
      is_certificate
          ? "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; sandbox"
          : "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
            "connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'");
}

}  // namespace

struct Station::Parts {
  explicit Parts(const StationOptions& given)
      : history(given.history), launcher(given.launcher), feed(history) {}
  ~Parts() {
    stopping = true;
    server.reset();
  }

  HttpReply answer(const HttpRequest& request);
  HttpReply get(const HttpRequest& request);
  HttpReply post(const HttpRequest& request);
  HttpReply station(const HttpRequest& request);
  HttpReply stream();
  HttpReply download(const std::string& path);
  HttpReply recorded(storage::RunId run, const std::string& name) const;
  HttpReply order(const HttpRequest& request) const;
  HttpReply start_run(const HttpRequest& request);
  HttpReply health() const;

  History history;
  Launcher launcher;
  LiveFeed feed;
  std::unique_ptr<Guard> guard;
  std::shared_ptr<std::atomic<int>> viewers = std::make_shared<std::atomic<int>>(0);
  std::atomic<bool> stopping{false};
  std::unique_ptr<HttpServer> server;  ///< ends first: its threads use all of the above
};

HttpReply Station::Parts::answer(const HttpRequest& request) {
  auto refused = guard->refuse(request);
  HttpReply reply;
  if (refused) {
    reply = *std::move(refused);
    const bool for_person = request.header("accept").find("text/html") != std::string::npos;
    if (reply.status == 401 && for_person) {
      reply.body = kStationLogin;
      reply.type = "text/html; charset=utf-8";
    }
  } else {
    reply = request.method == "POST" ? post(request) : get(request);
  }
  harden(reply, request.path.ends_with("/certificate.html"));
  return reply;
}

HttpReply Station::Parts::get(const HttpRequest& request) {
  const std::string& path = request.path;
  if (path == "/" || path == "/kiosk") {
    return {.type = "text/html; charset=utf-8",
            .body = page(path == "/kiosk"),
            .headers = {{"Cache-Control", "no-store"}},
            .stream = {}};
  }
  for (const Asset& asset : kAssets) {
    if (path != asset.path) continue;
    return {.type = asset.type,
            .body = asset.text,
            .headers = {{"Cache-Control", "no-cache"}},
            .stream = {}};
  }
  if (path == "/healthz") return health();
  if (path == "/api/station") return station(request);
  if (path == "/api/live") return HttpReply::json(200, feed.newest()->text);
  if (path == "/api/stream") return stream();
  if (path == "/api/trace") return HttpReply::json(200, feed.trace());
  if (path == "/api/poses") return HttpReply::json(200, feed.poses());
  if (path == "/api/events") return HttpReply::json(200, feed.events());
  if (path == "/api/runs") {
    const auto most = integer(request.parameter("most"));
    return reply_of(
        history.runs_json(
            request.parameter("serial"),
            most && *most > 0 ? std::min(static_cast<std::size_t>(*most), kMostRuns) : kMostRuns),
        503);
  }
  if (path == "/api/trends") return reply_of(history.trends_json(), 503);
  if (path == "/api/compare") {
    const auto a = integer(request.parameter("a"));
    const auto b = integer(request.parameter("b"));
    if (!a || !b) return refusal(400, "a and b are numbers of runs");
    return reply_of(history.compare_json(*a, *b), 404);
  }
  if (path == "/metrics") {
    const auto runs = history.runs();
    if (!runs) return HttpReply::text(503, runs.error().message);
    return {.type = "text/plain; version=0.0.4; charset=utf-8",
            .body = metrics_text(feed.status(), *runs, viewers->load()),
            .headers = {},
            .stream = {}};
  }
  if (path.starts_with("/runs/")) return download(path);
  return HttpReply::text(404, "there is no such page");
}

HttpReply Station::Parts::post(const HttpRequest& request) {
  if (request.path == "/login") {
    const Json json = Json::parse(request.body, nullptr, false);
    const Json token = json.is_object() ? json.value("token", Json()) : Json();
    const auto cookie =
        token.is_string() ? guard->cookie_for(token.get<std::string>()) : std::nullopt;
    if (!cookie) return refusal(401, "not a token of this station");
    HttpReply reply = HttpReply::json(200, "{\"ok\":true}");
    reply.headers.emplace_back("Set-Cookie", *cookie);
    return reply;
  }
  if (request.path == "/api/order") return order(request);
  if (request.path == "/api/start") return start_run(request);
  return refusal(404, "there is no such action");
}

HttpReply Station::Parts::station(const HttpRequest& request) {
  // The kiosk page asks, too, and gets nothing that it could act with.
  const bool control =
      guard->may_control(request) && request.header("referer").find("/kiosk") == std::string::npos;
  Json plans = Json::array();
  Json resumable = Json::array();
  for (const StationPlan& plan : launcher.options().plans) {
    plans.push_back(plan.name);
    if (!plan.simulated) resumable.push_back(plan.name);
  }
  return HttpReply::json(200, dump({{"control", control},
                                    {"csrf", control ? Json(guard->csrf()) : Json()},
                                    {"plans", control ? plans : Json::array()},
                                    {"resumable", control ? resumable : Json::array()},
                                    {"last_start", launcher.last_json()},
                                    {"program_version", program_version()},
                                    {"database", history.options().database.filename().string()},
                                    {"golden", history.options().golden}}));
}

HttpReply Station::Parts::stream() {
  auto slot = std::shared_ptr<void>(nullptr, [count = viewers](void*) { --*count; });
  if (++*viewers > kMostViewers) {  // the slot gives its place back
    HttpReply reply = refusal(503, "as many viewers as this station serves; ask /api/live instead");
    reply.headers.emplace_back("Retry-After", "10");
    return reply;
  }
  HttpReply reply;
  auto sent = std::make_shared<std::uint64_t>(0);
  reply.stream = [this, slot, sent](std::string& text) {
    for (auto left = kHeartbeat; left.count() > 0; left -= kTurn) {
      if (stopping) return false;
      const auto message = feed.wait(*sent, kTurn);
      if (!message) continue;
      *sent = message->version;
      text = fmt::format("id: {}\ndata: {}\n\n", message->version, message->text);
      return true;
    }
    return true;
  };
  return reply;
}

HttpReply Station::Parts::download(const std::string& path) {
  const std::string rest = path.substr(std::string_view("/runs/").size());
  const std::size_t slash = rest.find('/');
  const auto run = integer(rest.substr(0, slash));
  if (!run || slash == std::string::npos) return HttpReply::text(404, "there is no such run");
  const std::string name = rest.substr(slash + 1);
  // Names are compared with a list, never joined to a path.
  for (const Download& file : kResultFiles) {
    if (name != file.name) continue;
    const auto entry = history.run(*run);
    if (!entry) return HttpReply::text(404, entry.error().message);
    if (!entry->result) return HttpReply::text(404, "this run has no result");
    auto text = read_file(entry->result->folder / file.name);
    if (!text) return HttpReply::text(404, "there is no such file");
    return {.type = file.type, .body = *std::move(text), .headers = {}, .stream = {}};
  }
  return recorded(*run, name);
}

HttpReply Station::Parts::recorded(storage::RunId run, const std::string& name) const {
  if (name != "samples.csv" && name != "static.csv" && name != "confirm.csv" &&
      name != "run.toml") {
    return HttpReply::text(404, "there is no such file");
  }
  const auto store = storage::RunStore::open_read_only(history.options().database);
  if (!store) return HttpReply::text(503, store.error().message);
  const auto stored = store->load(run);
  if (!stored) return HttpReply::text(404, stored.error().message);
  HttpReply reply = HttpReply::text(200, "");
  reply.headers.emplace_back("Content-Disposition",
                             fmt::format("attachment; filename=\"run-{}-{}\"", run, name));
  if (name == "run.toml") {
    reply.body = stored->summary.header.config_toml;
    return reply;
  }
  reply.type = "text/csv; charset=utf-8";
  const bool empty = name == "static.csv"    ? stored->soak.size() == 0
                     : name == "confirm.csv" ? stored->verification.poses.empty()
                                             : stored->grid.poses.empty();
  if (empty) return HttpReply::text(404, "the run has no such record");
  const Scratch scratch;
  const fs::path file = scratch / "record.csv";
  const auto written =
      name == "static.csv"
          ? write_static(file, stored->soak)
          : write_samples(file, name == "confirm.csv" ? stored->verification : stored->grid);
  auto text = written ? read_file(file) : Result<std::string>(fail(written.error()));
  if (!text) return HttpReply::text(500, "the file cannot be made");
  reply.body = *std::move(text);
  return reply;
}

HttpReply Station::Parts::order(const HttpRequest& request) const {
  const Json json = Json::parse(request.body, nullptr, false);
  const Json word = json.is_object() ? json.value("order", Json()) : Json();
  if (word != "pause" && word != "resume" && word != "stop") {
    return refusal(400, "an order is pause, resume or stop");
  }
  Json command = {{"command", word}};
  if (word == "pause") command["at"] = json.value("at", Json("now"));
  auto client = ControlClient::connect(control_path(history.options().database));
  if (!client) return refusal(409, "no run is being measured");
  const auto reply = client->ask(command);
  if (!reply) return refusal(409, reply.error().message);
  return HttpReply::json(reply->value("ok", false) ? 200 : 400, dump(*reply));
}

HttpReply Station::Parts::start_run(const HttpRequest& request) {
  const auto order = start_order(Json::parse(request.body, nullptr, false));
  if (!order) return refusal(400, order.error().message);
  if (feed.session_running()) return refusal(409, "a run is under way already");
  if (const auto started = launcher.start(*order); !started) {
    return refusal(409, started.error().message);
  }
  return HttpReply::json(200, "{\"ok\":true}");
}

HttpReply Station::Parts::health() const {
  std::error_code ignored;
  if (fs::exists(history.options().database, ignored)) {
    const auto store = storage::RunStore::open_read_only(history.options().database);
    if (!store || !store->runs()) {
      return HttpReply::json(503, dump({{"status", "database cannot be read"}}));
    }
  }
  return HttpReply::json(200, "{\"status\":\"ok\"}");
}

Station::Station(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Station::~Station() = default;

Result<std::unique_ptr<Station>> Station::start(const StationOptions& options) {
  if (!options.guard.address.is_loopback() && options.guard.tokens.control.empty() &&
      options.guard.tokens.view.empty()) {
    return fail(ErrorCode::input,
                fmt::format("{} can be reached from other machines: give --token-file",
                            options.guard.address.text()));
  }
  auto parts = std::make_unique<Parts>(options);
  // The port is known once it is taken, and requests may come from then on.
  auto ready = std::make_shared<std::atomic<bool>>(false);
  auto server = HttpServer::start(options.guard.address,
                                  [raw = parts.get(), ready](const HttpRequest& request) {
                                    while (!*ready) std::this_thread::sleep_for(milliseconds(1));
                                    return raw->answer(request);
                                  });
  if (!server) return fail(server.error());
  parts->server = *std::move(server);
  GuardOptions guard = options.guard;
  guard.address = parts->server->address();
  parts->guard = std::make_unique<Guard>(guard);
  *ready = true;
  return std::unique_ptr<Station>(new Station(std::move(parts)));
}

const ListenAddress& Station::address() const { return parts_->server->address(); }

void Station::let_viewers_see_the_end() const {
  if (parts_->viewers->load() == 0) return;
  parts_->feed.catch_up(kFarewell);
  std::this_thread::sleep_for(5 * kTurn);  // the last message is on its way
}

}  // namespace plumbline::app
