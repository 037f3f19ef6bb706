#include "app/command/measure.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <optional>

#include "app/calibration_job.h"
#include "app/sequencer/progress.h"

namespace plumbline::app {

namespace {

/// Signal handlers reach nothing but this.
EngineControl control;

void on_signal(int /*number*/) { control.request_stop(); }

/// SIGINT and SIGTERM ask the engine to stop, as long as this lives.
class StopOnSignal {
 public:
  StopOnSignal() {
    struct sigaction action {};
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, &interrupt_);
    sigaction(SIGTERM, &action, &terminate_);
  }
  ~StopOnSignal() {
    sigaction(SIGINT, &interrupt_, nullptr);
    sigaction(SIGTERM, &terminate_, nullptr);
  }
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

 private:
  struct sigaction interrupt_ {};
  struct sigaction terminate_ {};
};

Result<storage::RunId> measure(const MeasureRequest& request) {
  const StopOnSignal stop_on_signal;
  ProgressDisplay display(stderr, isatty(STDERR_FILENO) != 0);
  const auto session = run_session(request.session, control,
                                   [&](const Progress& progress) { display.show(progress); });
  if (!session) return fail(session.error());
  if (session->outcome) return session->run;
  return fail(session->outcome.error().code,
              fmt::format("run {} in {}: {}; what was measured is kept, go on with: {}",
                          session->run, request.session.database.string(),
                          session->outcome.error().message, request.resume_hint));
}

}  // namespace

Result<ExitCode> measure_and_calibrate(const MeasureRequest& request) {
  const auto run = measure(request);
  if (!run) return fail(run.error());
  auto job = job_from_database(request.session.database, *run, request.seed);
  if (!job) return fail(job.error());
  job->style = request.style;
  const auto outcome = perform(*job, request.out);
  if (!outcome) return fail(outcome.error());
  fmt::print("run {} in {}\n{}\n", *run, request.session.database.string(), outcome->summary);
  return outcome->exit_code;
}

}  // namespace plumbline::app
