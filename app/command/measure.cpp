#include "app/command/measure.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <limits>
#include <thread>

#include "app/calibration_job.h"
#include "app/config/own_effects.h"
#include "app/provenance.h"
#include "app/sequencer/control_socket.h"
#include "app/sequencer/live_state.h"
#include "app/sequencer/progress.h"
#include "app/sequencer/separation_plan.h"
#include "rig/acquisition.h"

namespace plumbline::app {

namespace {

/// Signal handlers reach nothing but this.
EngineControl control;

/// The second one is in a hurry.
void on_end(int /*number*/) {
  if (control.stop_requested()) {
    control.request_abort();
  } else {
    control.request_stop();
  }
}

/// Ctrl-Z: the program goes on, the motors do not; once more, and they do again.
void on_pause(int /*number*/) {
  if (control.pause_requested() == EngineControl::Pause::none) {
    control.request_pause(EngineControl::Pause::now);
  } else {
    control.request_resume();
  }
}

void on_pause_at_pose(int /*number*/) { control.request_pause(EngineControl::Pause::at_pose); }
void on_resume(int /*number*/) { control.request_resume(); }

/// Signals give orders to the engine, as long as this lives.
class OrdersBySignal {
 public:
  OrdersBySignal() {
    for (std::size_t i = 0; i < kOrders.size(); ++i) {
      struct sigaction action {};
      action.sa_handler = kOrders[i].handler;
      sigemptyset(&action.sa_mask);
      sigaction(kOrders[i].number, &action, &before_[i]);
    }
  }
  ~OrdersBySignal() {
    for (std::size_t i = 0; i < kOrders.size(); ++i) {
      sigaction(kOrders[i].number, &before_[i], nullptr);
    }
  }
  OrdersBySignal(const OrdersBySignal&) = delete;
  OrdersBySignal& operator=(const OrdersBySignal&) = delete;

 private:
  struct Order {
    int number;
    void (*handler)(int);
  };
  static constexpr std::array kOrders = {
      Order{SIGINT, on_end},    Order{SIGTERM, on_end},           Order{SIGHUP, on_end},
      Order{SIGTSTP, on_pause}, Order{SIGUSR1, on_pause_at_pose}, Order{SIGUSR2, on_resume}};
  std::array<struct sigaction, kOrders.size()> before_{};
};

/// Whether the file can be read and asks for nothing that this rig does not record.
Result<void> check_own_effects(const std::filesystem::path& path, const RigDescription& rig) {
  if (path.empty()) return {};
  SampleTable recorded;
  recorded.temp_C = {rig.run.reference_C};
  for (const rig::CovariateSignal& signal : rig.sensor.covariates)
    recorded.covariates.push_back({signal.column, {}});
  const auto effects = own_effects_for(path, rig.run.reference_C, recorded);
  return effects ? Result<void>{} : fail(effects.error());
}

Result<ExitCode> calibrate_run(const MeasureRequest& request, storage::RunId run,
                               std::string& sentence) {
  auto job = job_from_database(request.session.database, run, request.seed);
  if (!job) return fail(job.error());
  job->style = request.style;
  if (auto added = add_own_effects(request.effects, *job); !added) return fail(added.error());
  const auto outcome = perform(*job, request.out);
  if (!outcome) return fail(outcome.error());
  fmt::print("run {} in {}\n{}\n", run, request.session.database.string(), outcome->summary);
  sentence = outcome->summary.substr(outcome->summary.rfind('\n') + 1);
  return outcome->exit_code;
}

/// What the poses so far leave open and further ones would decide.
Result<FurtherSteps> poses_that_decide(const MeasureRequest& request, storage::RunId run) {
  auto job = job_from_database(request.session.database, run, request.seed);
  if (!job) return fail(job.error());
  if (auto added = add_own_effects(request.effects, *job); !added) return fail(added.error());
  const Calibration calibration = calibrate_job(*job);
  FurtherSteps further{
      separating_steps(calibration.diagnosis, request.session.rig.plan.samples_per_pose)};
  const std::vector<PlanStep>& steps = further.steps;
  for (const auto& [name, ambiguity] : calibration.diagnosis.findings()) {
    std::string reason = name;
    if (!ambiguity.alternatives.empty())
      reason += fmt::format(", or {}", fmt::join(ambiguity.alternatives, ", or "));
    if (!ambiguity.separate_by.empty()) reason += ": " + ambiguity.separate_by;
    fmt::print(stderr, "{}\n", reason);
    further.reasons.push_back(std::move(reason));
  }
  fmt::print(stderr, "separate: {}\n",
             steps.empty() ? std::string("no further poses are needed, or none would decide")
                           : fmt::format("{} further {} in the same run", steps.size(),
                                         steps.size() == 1 ? "pose" : "poses"));
  return further;
}

std::string chain_head_of(const std::filesystem::path& database, storage::RunId run) {
  const auto store = storage::RunStore::open_read_only(database);
  if (!store) return "";
  const auto runs = store->runs();
  if (!runs) return "";
  for (const storage::RunSummary& summary : *runs) {
    if (summary.id == run) return summary.chain_head;
  }
  return "";
}

}  // namespace

bool stop_was_requested() { return control.stop_requested(); }

Result<void> await_condition(const rig::SensorConfig& sensor, const WaitCondition& condition,
                             double patience_s) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kTurn{100};
  const OrdersBySignal orders;
  auto source = rig::make_sample_source(sensor);
  if (!source) return fail(source.error());
  rig::Acquisition acquisition(*std::move(source));
  Result<void> listening = acquisition.start();
  if (!listening) return listening;
  Clock::time_point heard_at = Clock::now();
  constexpr double kNever = std::numeric_limits<double>::infinity();
  double begin_s = kNever;
  double inside_since_s = kNever;
  const auto take = [&](double t_s, double value) {
    begin_s = std::min(begin_s, t_s);
    const bool inside = value >= condition.min && value <= condition.max;
    inside_since_s = inside ? std::min(inside_since_s, t_s) : kNever;
    return t_s - inside_since_s >= condition.hold_s;
  };
  while (!control.stop_requested()) {
    tell_service_manager("waiting for " + condition.column);
    if (!listening) {
      if (Clock::now() - heard_at > std::chrono::duration<double>(patience_s)) return listening;
      inside_since_s = kNever;  // what happened meanwhile nobody knows
      std::this_thread::sleep_for(kTurn);
      listening = acquisition.start();
      continue;
    }
    const auto batch = acquisition.take(kTurn);
    if (!batch) {
      listening = fail(batch.error());
      continue;
    }
    if (batch->ended) return fail(ErrorCode::rig, "the recorded log of the sensor ended");
    if (!batch->samples.empty()) heard_at = Clock::now();
    for (const RawSample& sample : batch->samples) {
      if (condition.column == "temp_C" && take(sample.t_s, sample.temp_C)) return {};
      if (sample.t_s - begin_s > condition.limit_s) {
        return fail(
            ErrorCode::rig,
            fmt::format("{} was not within {} to {} for {} s in {} s of waiting", condition.column,
                        condition.min, condition.max, condition.hold_s, condition.limit_s));
      }
    }
    for (const rig::CovariateReading& reading : batch->covariates) {
      if (reading.name == condition.column && take(reading.t_s, reading.value)) return {};
    }
  }
  return fail(ErrorCode::rig, "stopped on request");
}

LiveRun live_run(const MeasureRequest& request) {
  const RigDescription& rig = request.session.rig;
  return {.serial = rig.run.dut.serial,
          .database = request.session.database.string(),
          .out = request.out.string(),
          .started_utc = utc_now(),
          .rate_hz = rig.sensor.rate_hz,
          .adc = rig.sensor.adc};
}

Result<storage::RunId> measure(const MeasureRequest& request, LiveState& live, Notifier& notifier) {
  const OrdersBySignal orders;
  ProgressDisplay display(stderr, isatty(STDERR_FILENO) != 0);
  const auto socket = ControlSocket::open(control_path(request.session.database), live, control);
  if (!socket) return fail(socket.error());
  SessionRequest whole = request.session;
  if (request.separate)
    whole.further = [&request](storage::RunId run) { return poses_that_decide(request, run); };
  const auto session = run_session(whole, control, [&](const Progress& progress) {
    live.update(progress);
    notifier.update(progress);
    display.show(progress);
  });
  if (!session) return fail(session.error());
  if (session->outcome) return session->run;
  return fail(session->outcome.error().code,
              fmt::format("run {} in {}: {}; what was measured is kept, go on with: {}",
                          session->run, request.session.database.string(),
                          session->outcome.error().message, request.resume_hint));
}

Result<ExitCode> measure_and_calibrate(const MeasureRequest& request) {
  // Refused before the hours of measuring, not after them.
  if (auto good = check_own_effects(request.effects, request.session.rig); !good)
    return fail(good.error());
  LiveState live(live_run(request));
  Notifier notifier(request.notify, live);
  ExitSummary summary;
  const auto run = measure(request, live, notifier);
  Result<ExitCode> code = ExitCode::done;
  if (run) {
    notifier.calibrating();
    code = calibrate_run(request, *run, summary.message);
  } else {
    code = fail(run.error());
  }
  summary.exit_code = code ? *code : exit_code_of(code.error().code);
  if (!code) summary.message = code.error().message;
  const storage::RunId begun = live.snapshot().progress.run;
  if (!run && begun > 0) summary.resume = request.resume_hint;
  if (begun > 0) summary.chain_head = chain_head_of(request.session.database, begun);
  notifier.end(summary);
  return code;
}

}  // namespace plumbline::app
