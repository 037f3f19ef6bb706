#include "app/sequencer/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>
#include <regex>
#include <utility>

#include "app/provenance.h"
#include "app/sequencer/plan.h"
#include "app/sequencer/sample_guard.h"

namespace plumbline::app {

namespace {

struct Started {
  storage::RunId run = 0;
  StartPoint start;
  bool plan_is_done = false;     ///< only further poses are open
  bool nothing_is_left = false;  ///< the run is finished, but nothing has come of it yet
};

/// The event with which further poses begin.
constexpr const char* kFurther = "separate";
/// Those that say why.
constexpr const char* kReason = "found so far";
/// The one that says for which job of a queue a run was begun.
constexpr const char* kJob = "job";

storage::RunHeader header_of(const RigDescription& rig, const Plan& plan) {
  return {.serial = rig.run.dut.serial,
          .program_version = program_version(),
          .config_toml = rig.source,
          .plan_csv = to_csv(plan),
          .started_utc = utc_now(),
          .rate_hz = rig.sensor.rate_hz,
          .adc = rig.sensor.adc};
}

/// The text without the lines that say where drive and node are: after a replug they may have
/// moved, and who they are is asked of themselves.
std::string without_addresses(const std::string& toml) {
  static const std::regex address(R"(^[ \t]*(modbus|can)[ \t]*=.*$)", std::regex::multiline);
  return std::regex_replace(toml, address, "");
}

double seconds_since(const std::string& utc) {
  std::tm parts{};
  if (strptime(utc.c_str(), "%Y-%m-%dT%H:%M:%SZ", &parts) == nullptr) return 0;
  return std::difftime(std::time(nullptr), timegm(&parts));
}

/// After everything that is stored, by the wall clock where it can be believed.
double clock_of_resumption(const storage::StoredRun& stored, double rate_hz) {
  double last_s = 0;
  for (const SampleTable* table :
       {&stored.soak, &stored.grid.samples, &stored.verification.samples}) {
    if (table->size() > 0) last_s = std::max(last_s, table->t_s.back());
  }
  double start_s = last_s + 1 / rate_hz;
  if (!stored.events.empty()) {
    const storage::EventRecord& event = stored.events.back();
    start_s = std::max(start_s, event.t_s + seconds_since(event.utc));
  }
  return start_s;
}

/// The soak as it arrived, for learning the noise floor again.
std::vector<RawSample> soak_codes(const SampleTable& soak, const Adc& adc, double rate_hz) {
  std::vector<RawSample> samples(soak.size());
  const double mid_V = adc.volts(0);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].counter = std::llround(soak.t_s[i] * rate_hz);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      samples[i].code[axis] =
          static_cast<std::int32_t>(std::lround((soak.u_V[axis][i] - mid_V) / adc.lsb_V()));
    }
  }
  return samples;
}

Result<std::vector<PoseMean>> means_of(const storage::RunStore& store, storage::RunId run,
                                       const Plan& plan, const Adc& adc) {
  const auto poses = store.poses(run);
  if (!poses) return fail(poses.error());
  std::vector<PoseMean> means;
  for (const storage::PoseRecord& pose : *poses) {
    if (pose.kind == storage::PoseKind::soak) continue;
    const long long number = step_of(pose.ordinal, plan.steps.size());
    // A further pose has the number of a step, too, but stands elsewhere.
    const PlanStep& step = plan.steps[static_cast<std::size_t>(number)];
    if (step.target.delta_deg != pose.delta_deg || step.target.h_deg != pose.h_deg) continue;
    means.push_back(mean_of(pose, number, adc));
  }
  return means;
}

/// What a run that holds something already goes on from, but for the steps that are done.
Result<StartPoint> start_after(const storage::RunStore& store, storage::RunId run, const Plan& plan,
                               const RigDescription& rig) {
  StartPoint start;
  start.resumed = true;
  auto identity = store.identity(run);
  if (!identity) return fail(identity.error());
  start.identity = *std::move(identity);
  auto means = means_of(store, run, plan, rig.sensor.adc);
  if (!means) return fail(means.error());
  start.means = *std::move(means);
  const auto stored = store.load(run);
  if (!stored) return fail(stored.error());
  start.t_s = clock_of_resumption(*stored, rig.sensor.rate_hz);
  if (rig.settling.noise_V <= 0) {
    start.floor = learn_noise_floor(soak_codes(stored->soak, rig.sensor.adc, rig.sensor.rate_hz),
                                    rig.sensor.adc, static_cast<std::size_t>(rig.settling.window),
                                    rig.sensor.rate_hz);
  }
  return start;
}

/// Further poses are begun only when the plan is done: from then on nothing of it is open.
Result<bool> further_poses_begun(const storage::RunStore& store, storage::RunId run) {
  const auto events = store.events(run);
  if (!events) return fail(events.error());
  return std::any_of(events->begin(), events->end(),
                     [](const storage::EventRecord& event) { return event.kind == kFurther; });
}

Plan plan_of(const SessionRequest& request) {
  if (request.plan) return *request.plan;
  const RigDescription& rig = request.rig;
  return make_plan(rig.run.grid, rig.plan, rig.sensor.rate_hz);
}

/// What a whole run writes, events and the log of the database included, with a half to spare.
std::uintmax_t bytes_needed(const Plan& plan, double rate_hz) {
  constexpr double kBytesPerSample = 37 + 30;  // covariates beside them
  constexpr double kBytesPerStep = 4096;
  constexpr double kReserve = 1.5;
  constexpr double kFixed = 16e6;  // result, certificate, write-ahead log
  double samples = 0;
  for (const PlanStep& step : plan.steps) samples += step.samples + 2 * rate_hz;
  return static_cast<std::uintmax_t>(
      kFixed + kReserve * (samples * kBytesPerSample +
                           kBytesPerStep * static_cast<double>(plan.steps.size())));
}

Result<void> check_room(const std::filesystem::path& file, std::uintmax_t needed) {
  std::error_code error;
  const std::filesystem::path folder =
      file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  const auto space = std::filesystem::space(folder, error);
  if (error || space.available >= needed) return {};  // the database says what is wrong there
  return fail(ErrorCode::storage,
              fmt::format("{}: {} MB are free and the run needs up to {} MB; make room first",
                          folder.string(), space.available / 1'000'000, needed / 1'000'000 + 1));
}

Result<Started> find_unfinished(storage::RunStore& store, const SessionRequest& request,
                                const Plan& plan) {
  const RigDescription& rig = request.rig;
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::input, fmt::format("{}: {}", request.database.string(), why));
  };
  const auto runs = store.runs();
  if (!runs) return fail(runs.error());
  const storage::RunSummary* last = nullptr;
  for (const storage::RunSummary& run : *runs) {
    if (run.header.serial != rig.run.dut.serial) continue;
    if (last == nullptr || run.id > last->id) last = &run;
  }
  if (last == nullptr) {
    return refuse(fmt::format("holds no run of {} to resume", rig.run.dut.serial));
  }
  const auto further_begun = further_poses_begun(store, last->id);
  if (!further_begun) return fail(further_begun.error());
  const bool plan_is_done = *further_begun || last->state == storage::RunState::finished;
  // Ended between the plan and the further poses, it is open to whoever asks for those.
  const bool may_go_further = request.further && !*further_begun;
  const bool finished = last->state == storage::RunState::finished && !may_go_further;
  // It may have ended, by a power cut or a full disk, between the last pose and the results.
  if (finished && (request.out.empty() || std::filesystem::exists(request.out / "result.json"))) {
    return refuse(
        fmt::format("run {}, the last one of {}, is finished; start a new one without "
                    "--resume",
                    last->id, rig.run.dut.serial));
  }
  if (last->header.plan_csv != to_csv(plan)) {
    return refuse(
        fmt::format("run {} was started with another plan; resume it with the "
                    "configuration of then, or start a new run without --resume",
                    last->id));
  }
  if (without_addresses(last->header.config_toml) != without_addresses(rig.source)) {
    return refuse(
        fmt::format("run {} was started with another configuration; resume it with that "
                    "one, or start a new run without --resume",
                    last->id));
  }
  if (finished) return Started{.run = last->id, .start = {}, .nothing_is_left = true};
  auto start = start_after(store, last->id, plan, rig);
  if (!start) return fail(start.error());
  Started found{last->id, *std::move(start), plan_is_done};
  auto committed = store.committed_poses(last->id);
  if (!committed) return fail(committed.error());
  found.start.committed = *std::move(committed);
  auto suspects = store.suspect_poses(last->id);
  if (!suspects) return fail(suspects.error());
  found.start.suspects = *std::move(suspects);
  if (auto reopened = store.finish_run(last->id, storage::RunState::running, ""); !reopened) {
    return fail(reopened.error());
  }
  const auto noted = store.add_event(
      last->id, {found.start.t_s, utc_now(), "resume",
                 plan_is_done ? fmt::format("the plan's {} steps are done", plan.steps.size())
                              : fmt::format("{} of {} steps are stored",
                                            found.start.committed.size(), plan.steps.size())});
  if (!noted) return fail(noted.error());
  return found;
}

Result<Started> begin(storage::RunStore& store, const SessionRequest& request, const Plan& plan) {
  Started started;
  if (request.resume) {
    auto found = find_unfinished(store, request, plan);
    if (!found) return found;
    started = *std::move(found);
  } else {
    auto run = store.create_run(header_of(request.rig, plan));
    if (!run) return fail(run.error());
    started.run = *run;
    if (!request.job.empty()) {
      const auto noted = store.add_event(started.run, {0, utc_now(), kJob, request.job});
      if (!noted) return fail(noted.error());
    }
  }
  if (!request.operator_name.empty() && !started.nothing_is_left) {
    const auto noted = store.add_event(
        started.run, {started.start.t_s, utc_now(), "operator", request.operator_name});
    if (!noted) return fail(noted.error());
  }
  return started;
}

/// Drive and sensor, for one engine.
struct Connections {
  std::unique_ptr<rig::DividingHead> head;
  std::unique_ptr<rig::Acquisition> acquisition;
};

Result<Connections> connect_rig(const RigDescription& rig) {
  auto head = rig::make_dividing_head(rig.head);
  if (!head) return fail(head.error());
  auto source = rig::make_sample_source(rig.sensor);
  if (!source) return fail(source.error());
  Connections connections{*std::move(head), std::make_unique<rig::Acquisition>(*std::move(source))};
  if (auto started = connections.acquisition->start(); !started) return fail(started.error());
  return connections;
}

EngineOptions engine_options(const RigDescription& rig) {
  EngineOptions options;
  options.rate_hz = rig.sensor.rate_hz;
  options.adc = rig.sensor.adc;
  options.motion = {rig.head.speed_deg_s, rig.head.acceleration_deg_s2};
  options.settling = rig.settling;
  options.recovery = rig.recovery;
  options.suspend = rig.suspend;
  options.home_end_latched = rig.head.home_end_latched;
  options.node_tells_identity = rig.sensor.tells_identity;
  options.poll_interval = rig.head.poll_interval;
  options.watchdog = rig.head.watchdog;
  return options;
}

/// The plan with further steps from number `first` on, behind everything that the run has stored. A
/// step that was measured again has its number plus a multiple of the plan's length: the next free
/// multiple is where the new ones begin, and what lies between counts as done.
Plan lengthened(const Plan& plan, const std::vector<PlanStep>& steps, long long first,
                const PlanOptions& options) {
  Plan longer = plan;
  while (std::ssize(longer.steps) < first) {
    longer.steps.push_back(plan.steps[longer.steps.size() % plan.steps.size()]);
    longer.steps.back().ordinal = std::ssize(longer.steps) - 1;
  }
  // By way of the last pose of the grid, so that they have a pose before them that is in the data.
  rig::HeadAngles from = plan.steps.back().target;
  for (const PlanStep& step : plan.steps)
    if (step.kind == storage::PoseKind::grid) from = step.target;
  for (PlanStep step : steps) {
    step.ordinal = std::ssize(longer.steps);
    if (step.ordinal == first) step.via.push_back(from);
    if (options.one_sided && step.target.delta_deg < from.delta_deg)
      step.via.push_back({step.target.delta_deg - options.approach_deg, step.target.h_deg});
    from = step.target;
    longer.steps.push_back(std::move(step));
  }
  return longer;
}

/// Goes on with a run whose plan is done.
Result<void> run_further(const SessionRequest& request, const Plan& plan, storage::RunId run,
                         const FurtherSteps& further, storage::RunStore& store,
                         const EngineControl& control, const ProgressObserver& observer) {
  const RigDescription& rig = request.rig;
  const std::vector<PlanStep>& steps = further.steps;
  auto taken = store.committed_poses(run);
  if (!taken) return fail(taken.error());
  const auto suspects = store.suspect_poses(run);
  if (!suspects) return fail(suspects.error());
  taken->insert(taken->end(), suspects->begin(), suspects->end());
  const long long length = std::ssize(plan.steps);
  long long first = length;
  for (const long long ordinal : *taken) first = std::max(first, (ordinal / length + 1) * length);
  const Plan longer = lengthened(plan, steps, first, rig.plan);
  if (rig.soft_limits) {
    if (auto allowed = check_plan(longer, *rig.soft_limits); !allowed) return allowed;
  }
  auto start = start_after(store, run, plan, rig);
  if (!start) return fail(start.error());
  for (long long step = 0; step < first; ++step) start->committed.push_back(step);
  if (auto reopened = store.finish_run(run, storage::RunState::running, ""); !reopened)
    return reopened;
  auto noted =
      store.add_event(run, {start->t_s, utc_now(), kFurther,
                            fmt::format("{} further {} to tell effects apart", steps.size(),
                                        steps.size() == 1 ? "pose" : "poses")});
  for (const std::string& reason : further.reasons) {
    if (noted) noted = store.add_event(run, {start->t_s, utc_now(), kReason, reason});
  }
  if (!noted) return noted;
  const auto connections = connect_rig(rig);
  if (!connections) return fail(connections.error());
  Engine engine(*connections->head, *connections->acquisition, store, control, engine_options(rig),
                observer);
  return engine.run(longer, run, *start);
}

}  // namespace

Result<bool> resumable(const RigDescription& rig, const std::filesystem::path& database,
                       const std::string& job) {
  if (!std::filesystem::exists(database)) return false;
  const auto store = storage::RunStore::open_read_only(database);
  if (!store) return fail(store.error());
  const auto runs = store->runs();
  if (!runs) return fail(runs.error());
  const Plan plan = make_plan(rig.run.grid, rig.plan, rig.sensor.rate_hz);
  const storage::RunSummary* last = nullptr;
  for (const storage::RunSummary& run : *runs) {
    if (run.header.serial == rig.run.dut.serial) last = &run;
  }
  if (last == nullptr || last->header.plan_csv != to_csv(plan) ||
      without_addresses(last->header.config_toml) != without_addresses(rig.source)) {
    return false;
  }
  const auto events = store->events(last->id);
  if (!events) return fail(events.error());
  return std::any_of(events->begin(), events->end(), [&](const storage::EventRecord& event) {
    return event.kind == kJob && event.text == job;
  });
}

Result<Session> run_session(const SessionRequest& request, const EngineControl& control,
                            const ProgressObserver& observer) {
  const RigDescription& rig = request.rig;
  const Plan plan = plan_of(request);
  if (rig.soft_limits) {
    if (auto allowed = check_plan(plan, *rig.soft_limits); !allowed) return fail(allowed.error());
  }
  if (auto room = check_room(request.database, bytes_needed(plan, rig.sensor.rate_hz)); !room) {
    return fail(room.error());
  }
  auto connections = connect_rig(rig);
  if (!connections) return fail(connections.error());
  auto store = storage::RunStore::open(request.database);
  if (!store) return fail(store.error());
  auto begun = begin(*store, request, plan);
  if (!begun) return fail(begun.error());

  Session session{begun->run, {}};
  if (begun->nothing_is_left) return session;
  if (!begun->plan_is_done) {
    Engine engine(*connections->head, *connections->acquisition, *store, control,
                  engine_options(rig), observer);
    session.outcome = engine.run(plan, begun->run, begun->start);
  }
  *connections = {};  // nothing piles up while the poses are looked at
  if (!session.outcome) return session;
  FurtherSteps further;
  if (request.further) {
    auto asked_for = request.further(begun->run);
    if (!asked_for) {
      session.outcome = fail(asked_for.error());
      return session;
    }
    further = *std::move(asked_for);
  }
  if (!further.steps.empty()) {
    session.outcome = run_further(request, plan, begun->run, further, *store, control, observer);
  } else if (begun->plan_is_done) {
    session.outcome = store->finish_run(begun->run, storage::RunState::finished, utc_now());
  }
  return session;
}

}  // namespace plumbline::app
