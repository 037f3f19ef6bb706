#include "app/calibration_job.h"

#include <fmt/format.h>

#include "app/config/run_description.h"
#include "app/io/evaluation_json.h"
#include "app/io/output_folder.h"
#include "app/io/result_json.h"
#include "app/summary.h"

namespace plumbline::app {

namespace {

Result<void> check_observable(const Observability& observability, const std::string& source,
                              std::size_t poses) {
  if (observability.rank == 4) return {};
  return fail(ErrorCode::input,
              fmt::format("{}: the {} do not determine the model (rank {} of 4), not observable: "
                          "{}; measure at further angles",
                          source, poses == 1 ? "one pose does" : fmt::format("{} poses do", poses),
                          observability.rank, observability.unobservable));
}

bool exceeds_limits(const CalibrationOutcome& outcome, const std::optional<Limits>& limits) {
  const DecisionStatus status = outcome.calibration.decision.status;
  if (status == DecisionStatus::fail || status == DecisionStatus::conditional_fail) return true;
  return outcome.verification && !within_limits(*outcome.verification, limits).value_or(true);
}

}  // namespace

Result<CalibrationOutcome> perform(const CalibrationJob& job, const std::filesystem::path& out) {
  if (job.run.poses.empty()) return fail(ErrorCode::input, job.source + ": holds no pose");
  auto folder = OutputFolder::prepare(out);
  if (!folder) return fail(folder.error());

  CalibrationOutcome outcome;
  outcome.calibration = calibrate(
      {.run = job.run,
       .static_record = job.static_record.size() == 0 ? nullptr : &job.static_record,
       .description = job.description},
      {.seed = job.provenance.seed});
  const Calibration& calibration = outcome.calibration;
  if (auto good = check_observable(calibration.observability, job.source, job.run.poses.size());
      !good) {
    return fail(good.error());
  }
  if (!job.verification.poses.empty()) {
    const CertifiedModel model{.twelve = calibration.estimates.batch_ls,
                               .final = calibration.final.batch_ls,
                               .effects = calibration.diagnosis.effects};
    outcome.verification = evaluate(model, job.verification, job.description);
  }

  Provenance provenance = job.provenance;
  provenance.created_utc = utc_now();
  if (auto done = folder->write("result.json", file_text(result_json(calibration, provenance)));
      !done) {
    return fail(done.error());
  }
  if (outcome.verification) {
    const Json json = evaluation_json(*outcome.verification, job.description.limits, provenance);
    if (auto done = folder->write("evaluation.json", file_text(json)); !done) {
      return fail(done.error());
    }
  }
  if (auto done = folder->publish(); !done) return fail(done.error());

  outcome.exit_code =
      exceeds_limits(outcome, job.description.limits) ? ExitCode::limits_exceeded : ExitCode::done;
  outcome.summary = summary(job.description, calibration, outcome.verification);
  return outcome;
}

}  // namespace plumbline::app
