// `plumbline jobs`: a whole queue, one job after the other.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>
#include <string>

#include "app/calibration_job.h"
#include "app/command/command.h"
#include "app/command/measure.h"
#include "app/config/run_description.h"
#include "app/io/evaluation_json.h"
#include "app/io/output_folder.h"
#include "app/io/read_file.h"
#include "app/io/result_json.h"
#include "app/sequencer/job_queue.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

struct JobsArguments {
  std::string queue;
  bool estimate = false;
};

std::string duration(double seconds) {
  const auto whole = std::lround(seconds);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

/// OUT/jobs.json: what is done. Written anew after every job, never half.
class Ledger {
 public:
  static Result<Ledger> open(const fs::path& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) {
      return fail(ErrorCode::output, fmt::format("{}: cannot be made a folder ({})",
                                                 folder.string(), error.message()));
    }
    Ledger ledger(folder / "jobs.json");
    if (!fs::exists(ledger.file_)) return ledger;
    const auto text = read_file(ledger.file_);
    if (!text) return fail(text.error());
    const Json json = Json::parse(*text, nullptr, false);
    if (!json.is_object() || json.value("schema", "") != "plumbline.jobs/1") {
      return fail(ErrorCode::input,
                  fmt::format("{}: is no list of jobs; move it away", ledger.file_.string()));
    }
    ledger.jobs_ = json["jobs"];
    return ledger;
  }

  bool is_done(const std::string& name) const {
    const Json* job = find(name);
    return job != nullptr && job->value("done", false);
  }

  /// When the job was begun first, noted now if it never was: tells it from the one of that name
  /// of another night.
  Result<std::string> begin(const std::string& name) {
    if (const Json* job = find(name)) return job->value("started_utc", "");
    const std::string now = utc_now();
    if (auto noted = put({{"name", name}, {"done", false}, {"started_utc", now}}); !noted) {
      return fail(noted.error());
    }
    return now;
  }

  Result<void> put(Json entry) {
    for (auto job = jobs_.begin(); job != jobs_.end();) {
      job = job->value("name", "") == entry["name"] ? jobs_.erase(job) : job + 1;
    }
    jobs_.push_back(std::move(entry));
    const fs::path half = file_.string() + ".new";
    std::ofstream stream(half, std::ios::binary);
    stream << file_text({{"schema", "plumbline.jobs/1"}, {"jobs", jobs_}});
    stream.close();
    std::error_code error;
    if (stream) fs::rename(half, file_, error);
    if (stream && !error) return {};
    return fail(ErrorCode::output, file_.string() + ": cannot be written");
  }

 private:
  explicit Ledger(fs::path file) : file_(std::move(file)) {}
  const Json* find(const std::string& name) const {
    for (const Json& job : jobs_) {
      if (job.value("name", "") == name) return &job;
    }
    return nullptr;
  }
  fs::path file_;
  Json jobs_ = Json::array();
};

Result<ExitCode> verify_against(const fs::path& calibration, const MeasureRequest& request,
                                storage::RunId run) {
  const auto stored = read_result_json(calibration);
  if (!stored) return fail(stored.error());
  const auto job = job_from_database(request.session.database, run, request.seed);
  if (!job) return fail(job.error());
  const MeasurementSet& set = job->verification.poses.empty() ? job->run : job->verification;
  const Evaluation evaluation = evaluate(stored->model, set, job->description);
  auto folder = OutputFolder::prepare(request.out);
  if (!folder) return fail(folder.error());
  Provenance provenance = job->provenance;
  provenance.created_utc = utc_now();
  const Json json = evaluation_json(evaluation, 0, job->description.limits, provenance);
  if (auto done = folder->write("evaluation.json", file_text(json)); !done) {
    return fail(done.error());
  }
  if (auto done = folder->publish(); !done) return fail(done.error());
  return within_limits(evaluation, job->description.limits).value_or(true)
             ? ExitCode::done
             : ExitCode::limits_exceeded;
}

ExitSummary how_it_ended(const Result<ExitCode>& code) {
  return {.exit_code = code ? *code : exit_code_of(code.error().code),
          .message = code ? "" : code.error().message,
          .resume = {},
          .chain_head = {}};
}

/// Measures when that has not been done, then whatever the job asks for.
Result<ExitCode> perform_job(const Job& job, const JobQueue& queue, MeasureRequest& request) {
  const auto go_on = resumable(job.rig, queue.database, request.session.job);
  if (!go_on) return fail(go_on.error());
  request.session.resume = *go_on;
  // A job that is resumed met its condition when it began.
  if (job.wait_for && !*go_on) {
    fmt::print(stderr, "job {}: waiting for {} within {} to {}\n", job.name, job.wait_for->column,
               job.wait_for->min, job.wait_for->max);
    if (auto met = await_condition(job.rig.sensor, *job.wait_for, job.rig.recovery.wait_s); !met) {
      const LiveState live(live_run(request));
      Notifier(request.notify, live).end(how_it_ended(fail(met.error())));
      return fail(met.error());
    }
  }
  if (job.action == JobAction::calibrate) return measure_and_calibrate(request);
  LiveState live(live_run(request));
  Notifier notifier(request.notify, live);
  const auto run = measure(request, live, notifier);
  Result<ExitCode> code = ExitCode::done;
  if (!run) {
    code = fail(run.error());
  } else if (job.action == JobAction::verify) {
    notifier.calibrating();
    code = verify_against(queue.out / job.against / "result.json", request, *run);
  }
  notifier.end(how_it_ended(code));
  return code;
}

Result<ExitCode> run_jobs(const JobsArguments& arguments) {
  const auto queue = read_job_queue(arguments.queue);
  if (!queue) return fail(queue.error());
  double total_s = 0;
  for (const Job& job : queue->jobs) {
    total_s += planned_s(job);
    fmt::print("{:<20} {:<10} {:<16} about {}{}\n", job.name,
               job.action == JobAction::record      ? "record"
               : job.action == JobAction::calibrate ? "calibrate"
                                                    : "verify",
               job.rig.run.dut.serial, duration(planned_s(job)),
               job.wait_for ? fmt::format(", after {} is within {} to {}", job.wait_for->column,
                                          job.wait_for->min, job.wait_for->max)
                            : "");
  }
  fmt::print("{} jobs, about {} without waiting\n", queue->jobs.size(), duration(total_s));
  std::fflush(stdout);
  if (arguments.estimate) return ExitCode::done;

  auto ledger = Ledger::open(queue->out);
  if (!ledger) return fail(ledger.error());
  ExitCode worst = ExitCode::done;
  for (const Job& job : queue->jobs) {
    if (ledger->is_done(job.name)) {
      fmt::print("job {}: done before\n", job.name);
      continue;
    }
    const auto started_utc = ledger->begin(job.name);
    if (!started_utc) return fail(started_utc.error());
    MeasureRequest request{.session = {.rig = job.rig,
                                       .database = queue->database,
                                       .out = queue->out,
                                       .job = fmt::format("{} {}", job.name, *started_utc)},
                           .out = queue->out / job.name,
                           .notify = {.journal = queue->database.string() + ".log",
                                      .summary = {},
                                      .hook = queue->hook},
                           .resume_hint = "plumbline jobs " + arguments.queue};
    const auto code = perform_job(job, *queue, request);
    const ExitCode exit_code = code ? *code : exit_code_of(code.error().code);
    auto noted = ledger->put({{"name", job.name},
                              {"done", code.has_value()},
                              {"exit_code", static_cast<int>(exit_code)},
                              {"message", code ? Json() : Json(code.error().message)},
                              {"started_utc", *started_utc},
                              {"ended_utc", utc_now()}});
    if (!noted) return fail(noted.error());
    fmt::print("job {}: {}\n", job.name, code ? "done" : code.error().message);
    std::fflush(stdout);
    worst = std::max(worst, exit_code);
    if (!code && (queue->stop_on_fault || stop_was_requested())) return fail(code.error());
  }
  return worst;
}

}  // namespace

void add_jobs(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand("jobs", "do a queue of jobs; goes on where it was");
  auto arguments = std::make_shared<JobsArguments>();
  sub->add_option("queue", arguments->queue, "TOML file with the jobs")->required();
  sub->add_flag("--estimate", arguments->estimate, "only say what would be done and how long");
  sub->callback([arguments, &invocation] {
    invocation.action = [arguments] { return run_jobs(*arguments); };
  });
}

}  // namespace plumbline::app
