#include "app/station/live_feed.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <utility>

#include "app/config/rig_description.h"
#include "app/config/run_description.h"
#include "app/provenance.h"
#include "app/sequencer/control_socket.h"
#include "app/sequencer/engine.h"
#include "app/sequencer/plan.h"
#include "app/sequencer/sample_guard.h"
#include "app/station/running_fit.h"

namespace plumbline::app {

namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLookAgain{500};
/// Between sessions the results are looked through so many times less often.
constexpr int kTurnsPerLook = 3;
constexpr int kWatch_ms = 250;
/// A session gives a sign of life every kWatch_ms.
constexpr double kSilence_s = 5;
constexpr std::size_t kMostTrace = 6000;
constexpr std::size_t kMostEvents = 1000;
/// A calibration that takes longer has died.
constexpr double kCalculating_s = 1800;

double seconds_since(const std::string& utc) {
  std::tm parts{};
  if (strptime(utc.c_str(), "%Y-%m-%dT%H:%M:%SZ", &parts) == nullptr) return 1e9;
  return std::difftime(std::time(nullptr), timegm(&parts));
}

double number(const Json& value) { return value.is_number() ? value.get<double>() : std::nan(""); }

std::string one_line(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

PoseMean pose_from(const Json& json) {
  PoseMean pose;
  pose.step = json.at("step").get<long long>();
  const std::string kind = json.at("kind");
  pose.kind = kind == "soak"           ? storage::PoseKind::soak
              : kind == "verification" ? storage::PoseKind::verification
                                       : storage::PoseKind::grid;
  pose.target = {number(json.at("delta_deg")), number(json.at("h_deg"))};
  pose.t_s = number(json.at("t_s"));
  pose.settle_s = number(json.at("settle_s"));
  pose.samples = json.at("samples").get<std::size_t>();
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    pose.mean_V[i] = number(json.at("mean_V").at(i));
    pose.sd_V[i] = number(json.at("sd_V").at(i));
  }
  pose.temp_C = number(json.at("temp_C"));
  return pose;
}

std::string trace_row(const Json& sample) {
  const Json& u = sample.at("u_V");
  return fmt::format("[{},{},{},{},{}]", sample.at("t_s").dump(), u.at(0).dump(), u.at(1).dump(),
                     u.at(2).dump(), sample.at("temp_C").dump());
}

Json range_json(const AngleRange& range) {
  return Json::array({range.start_deg, range.stop_deg, range.step_deg});
}

/// Three a pose: what needs attention would drown in them.
bool is_routine(const std::string& text) {
  return text.starts_with("moving: ") || text.starts_with("settling: ") ||
         text.starts_with("sampling: ");
}

}  // namespace

LiveFeed::LiveFeed(const History& history) : history_(history) {
  refit();
  look_at_database();
  thread_ = std::jthread([this](const std::stop_token& stop) { follow(stop); });
}

LiveFeed::~LiveFeed() {
  thread_.request_stop();
  thread_.join();
}

std::shared_ptr<const LiveMessage> LiveFeed::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

std::shared_ptr<const LiveMessage> LiveFeed::wait(std::uint64_t version,
                                                  milliseconds longest) const {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, longest, [&] { return newest_->version != version; })) return {};
  return newest_;
}

std::string LiveFeed::trace() const {
  const std::lock_guard lock(mutex_);
  std::string text = "{\"trace\":[";
  for (std::size_t i = 0; i < trace_.size(); ++i) text += (i > 0 ? "," : "") + trace_[i];
  return text + "]}";
}

std::string LiveFeed::poses() const {
  const std::lock_guard lock(mutex_);
  return poses_text_;
}

std::string LiveFeed::events() const {
  const std::lock_guard lock(mutex_);
  Json list = Json::array();
  for (const LiveEvent& event : events_) list.push_back(event.json);
  return one_line({{"events", std::move(list)}});
}

Json LiveFeed::status() const {
  const std::lock_guard lock(mutex_);
  return running_ ? status_ : Json();
}

bool LiveFeed::session_running() const {
  const std::lock_guard lock(mutex_);
  return running_;
}

void LiveFeed::catch_up(milliseconds longest) {
  std::unique_lock lock(mutex_);
  const std::uint64_t wanted = ++looks_wanted_;
  changed_.notify_all();
  changed_.wait_for(lock, longest, [&] {
    return looks_done_ >= wanted && phase_ != "running" && phase_ != "calculating";
  });
}

void LiveFeed::follow(const std::stop_token& stop) {
  for (int turn = 0; !stop.stop_requested(); ++turn) {
    auto client = ControlClient::connect(control_path(history_.options().database));
    if (client) {
      follow_session(*client, stop);
      const std::lock_guard lock(mutex_);
      running_ = false;
      status_ = Json();
      turn = 0;
    }
    std::unique_lock lock(mutex_);
    const std::uint64_t wanted = looks_wanted_;
    const bool look = turn % kTurnsPerLook == 0 || wanted > looks_done_;
    lock.unlock();
    if (look) look_at_database();
    lock.lock();
    looks_done_ = wanted;
    changed_.notify_all();
    changed_.wait_for(lock, stop, kLookAgain, [&] { return looks_wanted_ > looks_done_; });
  }
}

void LiveFeed::follow_session(ControlClient& client, const std::stop_token& stop) {
  // A second connection asks for poses: on this one only watch lines arrive.
  const auto watching = client.ask({{"command", "watch"}, {"interval_ms", kWatch_ms}});
  if (!watching || !watching->is_object() || !watching->value("ok", false)) return;
  auto asking = ControlClient::connect(control_path(history_.options().database));
  if (!asking) return;
  while (!stop.stop_requested()) {
    auto line = client.receive(kSilence_s);
    if (!line) return;
    try {
      Json status = std::move(line->at("status"));
      const std::string session =
          fmt::format("{} {}", status.at("pid").dump(), status.at("run").dump());
      if (session != session_) {
        begin_run(status);
        session_ = session;
      }
      const int suspects = status.at("attention").at("suspects").get<int>();
      const auto total = status.at("poses").get<std::size_t>();
      if (suspects != suspects_) {  // poses were taken out again
        suspects_ = suspects;
        read_stored(run_);
        refit();
      }
      if (total > taken_) take_poses(*asking, total);
      take(std::move(status));
    } catch (const Json::exception&) {
      return;  // not a status of this program's
    }
  }
}

/// Another session: forget what belongs to the one before.
void LiveFeed::begin_run(const Json& status) {
  const storage::RunId run = status.at("run").is_number() ? status.at("run").get<long long>() : 0;
  taken_ = 0;
  suspects_ = 0;
  newest_sample_s_ = -1;
  run_ = run;
  {
    const std::lock_guard lock(mutex_);
    trace_.clear();
    events_.clear();
  }
  run_json_ = {{"id", run > 0 ? Json(run) : Json()},
               {"serial", status.at("serial")},
               {"started_utc", status.at("started_utc")}};
  means_.clear();
  if (run > 0) read_stored(run);
  refit();
}

void LiveFeed::read_plan(const std::string& config_toml) {
  // A file for a rig holds more than one for a run; either may be stored.
  const auto rig = parse_rig_description(config_toml, "stored configuration");
  auto description = rig ? Result<RunDescription>(rig->run)
                         : parse_run_description(config_toml, "stored configuration");
  if (!description) return;
  gamma_ = description->gravity.local_mps2 / kStandardGravity_mps2;
  run_json_["delta_deg"] = range_json(description->grid.delta);
  run_json_["h_deg"] = range_json(description->grid.h);
}

/// The poses that are in the database already: of earlier sessions of a run, or of all of it.
void LiveFeed::read_stored(storage::RunId run) {
  means_.clear();
  const auto store = storage::RunStore::open_read_only(history_.options().database);
  if (!store) return;
  const auto runs = store->runs();
  if (!runs) return;
  const auto summary = std::find_if(runs->begin(), runs->end(),
                                    [&](const storage::RunSummary& one) { return one.id == run; });
  if (summary == runs->end()) return;
  const storage::RunHeader& header = summary->header;
  read_plan(header.config_toml);
  const auto lines = std::count(header.plan_csv.begin(), header.plan_csv.end(), '\n');
  const auto steps = static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, lines - 1));
  const auto poses = store->poses(run);
  if (poses) {
    for (const storage::PoseRecord& pose : *poses) {
      const long long step = step_of(pose.ordinal, steps);
      means_[step] = mean_of(pose, step, header.adc);
    }
  }
  const auto events = store->events(run);
  if (!events) return;
  const std::lock_guard lock(mutex_);
  for (const storage::EventRecord& event : *events) {
    add_event(event.t_s, event.kind, event.text,
              {{"t_s", json_number(event.t_s)},
               {"utc", event.utc},
               {"kind", event.kind},
               {"text", event.text}});
  }
}

void LiveFeed::add_event(double t_s, const std::string& kind, const std::string& text, Json json) {
  if (kind == "state" && is_routine(text)) return;
  LiveEvent event{std::isfinite(t_s) ? std::llround(1e3 * t_s) : 0, kind + " " + text,
                  std::move(json)};
  // Of the same instant they stand in the order in which they were told.
  const auto [first, last] =
      std::equal_range(events_.begin(), events_.end(), event,
                       [](const LiveEvent& a, const LiveEvent& b) { return a.t_ms < b.t_ms; });
  const bool known =
      std::any_of(first, last, [&](const LiveEvent& other) { return other.text == event.text; });
  if (known) return;
  events_.insert(last, std::move(event));
  if (events_.size() > kMostEvents) events_.erase(events_.begin());
}

void LiveFeed::take_poses(ControlClient& client, std::size_t total) {
  while (taken_ < total) {
    const auto reply = client.ask({{"command", "poses"}, {"first", taken_}});
    if (!reply || !reply->value("ok", false)) return;
    const Json& list = reply->at("poses");
    if (list.empty()) return;
    for (const Json& json : list) {
      const PoseMean pose = pose_from(json);
      means_[pose.step] = pose;
    }
    taken_ += list.size();
  }
  refit();
}

void LiveFeed::refit() {
  std::vector<PoseMean> used;
  for (const auto& [step, pose] : means_) {
    if (pose.kind != storage::PoseKind::soak) used.push_back(pose);
  }
  const auto fit = running_fit(used, gamma_);
  estimate_ = fit ? running_fit_json(*fit) : Json();
  const PerAxis<double> sd_V = pooled_sd_V(used);
  noise_ = {{"sd_V", json_array(sd_V)}, {"sd_mps2", Json()}};
  if (fit) {
    PerAxis<double> sd_mps2{};
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      sd_mps2[i] = sd_V[i] * kStandardGravity_mps2 / std::abs((*fit)[i].value[i]);
    }
    noise_["sd_mps2"] = json_array(sd_mps2);
  }
  ++poses_version_;
  std::string rows;
  for (std::size_t i = 0; i < used.size(); ++i) {
    const PoseMean& pose = used[i];
    if (pose.kind != storage::PoseKind::grid) continue;
    Json row = {pose.step, pose.target.delta_deg, pose.target.h_deg};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      row.push_back(fit ? json_number((*fit)[axis].residual_mps2[i]) : Json());
    }
    row.push_back(json_number(pose.settle_s));
    row.push_back(json_number(pose.temp_C));
    rows += (rows.empty() ? "" : ",") + one_line(row);
  }
  const std::lock_guard lock(mutex_);
  poses_text_ =
      fmt::format("{{\"poses_version\":{},\"poses\":[{}]}}", poses_version_, std::move(rows));
}

void LiveFeed::take(Json status) {
  fresh_trace_.clear();
  for (const Json& sample : status.at("samples")) {
    const double t_s = number(sample.at("t_s"));
    if (!(t_s > newest_sample_s_)) continue;
    newest_sample_s_ = t_s;
    fresh_trace_.push_back(trace_row(sample));
  }
  {
    const std::lock_guard lock(mutex_);
    for (const std::string& row : fresh_trace_) trace_.push_back(row);
    while (trace_.size() > kMostTrace) trace_.pop_front();
    for (const Json& event : status.at("events")) {
      add_event(number(event.at("t_s")), event.at("kind").get<std::string>(),
                event.at("text").get<std::string>(), event);
    }
    running_ = true;
    status_ = status;
  }
  status.erase("samples");
  status.erase("events");
  publish({{"phase", "running"}, {"status", std::move(status)}, {"verdict", Json()}});
}

/// Between sessions: how the last run ended, and what came out of it.
void LiveFeed::look_at_database() {
  fresh_trace_.clear();
  const auto all = history_.runs();
  if (!all || all->empty()) {
    run_json_ = Json();
    session_.clear();
    publish({{"phase", "empty"}, {"status", Json()}, {"verdict", Json()}});
    return;
  }
  const HistoryRun& last = *std::max_element(
      all->begin(), all->end(),
      [](const HistoryRun& a, const HistoryRun& b) { return a.run.id < b.run.id; });
  if (last.run.id != run_ || session_.empty()) {
    session_ = "database";
    run_ = last.run.id;
    run_json_ = {{"id", run_},
                 {"serial", last.run.header.serial},
                 {"started_utc", last.run.header.started_utc}};
    read_stored(run_);
    refit();
  }
  run_json_["finished_utc"] = last.run.finished_utc;
  std::string phase = to_string(last.run.state);
  if (last.run.state == storage::RunState::running) phase = "interrupted";
  Json verdict;
  if (last.result) {
    verdict = result_summary_json(*last.result);
    phase = "finished";
  } else if (last.run.state == storage::RunState::finished &&
             seconds_since(last.run.finished_utc) < kCalculating_s) {
    phase = "calculating";
  }
  publish({{"phase", phase}, {"status", Json()}, {"verdict", std::move(verdict)}});
}

void LiveFeed::publish(Json message) {
  message["schema"] = "plumbline.live/1";
  const std::string phase = message.at("phase");
  message["run"] = run_json_;
  message["estimate"] = estimate_;
  message["noise"] = noise_;
  message["poses_version"] = poses_version_;
  std::string text = one_line(message);
  // Nothing new and no session: viewers are left in peace.
  const auto before = newest();
  text.pop_back();
  text += ",\"trace\":[";
  for (std::size_t i = 0; i < fresh_trace_.size(); ++i) {
    text += (i > 0 ? "," : "") + fresh_trace_[i];
  }
  text += "]}";
  if (before->text == text) return;
  auto made = std::make_shared<LiveMessage>();
  made->version = ++version_;
  made->text = std::move(text);
  const std::lock_guard lock(mutex_);
  newest_ = std::move(made);
  phase_ = phase;
  changed_.notify_all();
}

}  // namespace plumbline::app
