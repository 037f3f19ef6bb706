#include "app/calibration_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "app/certificate/certificate_files.h"
#include "app/config/rig_description.h"
#include "app/config/run_description.h"
#include "app/io/csv.h"
#include "app/io/evaluation_json.h"
#include "app/io/output_folder.h"
#include "app/io/result_json.h"
#include "app/io/sha256.h"
#include "app/issue_time.h"
#include "app/sequencer/separation_plan.h"
#include "app/summary.h"
#include "estimator/decision.h"
#include "estimator/parallel_for.h"
#include "estimator/quantization/interval_fit.h"

namespace plumbline::app {

namespace {

/// A scale factor must exceed its standard uncertainty by this factor to mean anything.
constexpr double kLeastSignificance = 5;

Result<void> check_observable(const Observability& observability, const std::string& source,
                              std::size_t poses) {
  if (observability.rank == 4) return {};
  return fail(ErrorCode::input,
              fmt::format("{}: the {} do not determine the model (rank {} of 4), not observable: "
                          "{}; measure at further angles",
                          source, poses == 1 ? "one pose does" : fmt::format("{} poses do", poses),
                          observability.rank, observability.unobservable));
}

/// An output that does not follow the acceleration has no input-referred error. One of which the
/// model leaves little does follow it, however uncertain what is left makes the scale factor.
Result<void> check_responsive(const Calibration& calibration, const std::string& source) {
  constexpr double kLittle_mps2 = 0.5 * kStandardGravity_mps2;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisEstimate& estimate = calibration.estimates.batch_ls[axis];
    const auto diagonal = static_cast<Eigen::Index>(axis);
    const double scale = estimate.value[diagonal];
    const double u = std::sqrt(estimate.covariance(diagonal, diagonal));
    if (std::abs(scale) > kLeastSignificance * u ||
        calibration.before.fit_pose_rms_mps2[axis] < kLittle_mps2)
      continue;
    return fail(
        ErrorCode::input,
        fmt::format("{}: output {} does not follow the acceleration (K_{}{} = {:.3g} ± {:.2g} "
                    "V/g); is it connected?",
                    source, kAxisName[axis], kAxisName[axis], kAxisName[axis], scale, u));
  }
  return {};
}

/// Of an output that mostly is beyond what its converter reads, the rest tells nothing.
Result<void> check_on_scale(const CalibrationJob& job) {
  if (!job.description.adc) return {};
  const CodeScale scale = scale_of(*job.description.adc);
  const double half_V = 0.5 * scale.step_V;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const std::vector<double>& u_V = job.run.samples.u_V[axis];
    const auto is_off = [&](const Pose& pose) {
      return std::all_of(
          u_V.begin() + static_cast<std::ptrdiff_t>(pose.first),
          u_V.begin() + static_cast<std::ptrdiff_t>(pose.first + pose.count),
          [&](double u) { return u < scale.lowest_V + half_V || u > scale.highest_V - half_V; });
    };
    const auto off = std::count_if(job.run.poses.begin(), job.run.poses.end(), is_off);
    if (2 * off <= std::ssize(job.run.poses)) continue;
    return fail(
        ErrorCode::input,
        fmt::format("{}: output {} is at the end of the converter's range at {} of {} poses; "
                    "is it connected?",
                    job.source, kAxisName[axis], off, job.run.poses.size()));
  }
  return {};
}

/// What goes with the time is stated at the start of the run: of a clock that began decades before,
/// a drift is a bias that nobody knows.
Result<void> check_clock(const SampleTable& samples, const std::string& source) {
  constexpr double kMostRuns = 1e4, kShortest_s = 1;
  if (samples.t_s.empty()) return {};
  const double start_s = samples.t_s.front();
  const double run_s = std::max(samples.t_s.back() - start_s, kShortest_s);
  if (std::abs(start_s) <= kMostRuns * run_s) return {};
  return fail(ErrorCode::input, fmt::format("{}: t_s begins at {:.0f} s; it counts from the start "
                                            "of the run, so that is to be taken from it",
                                            source, start_s));
}

bool exceeds_limits(const CalibrationOutcome& outcome, const std::optional<Limits>& limits) {
  const DecisionStatus status = outcome.calibration.decision.status;
  if (status == DecisionStatus::fail || status == DecisionStatus::conditional_fail) return true;
  return outcome.verification && !within_limits(*outcome.verification, limits).value_or(true);
}

/// Fresh poses took no part in the fit either: the decision is by the largest error of all.
Decision with_fresh_poses(const Calibration& calibration, const Evaluation& verification) {
  const Decision& decision = calibration.decision;
  const PerAxis<double>& error_mps2 = verification.after.pose_max_abs_mps2;
  const auto worst = std::max_element(error_mps2.begin(), error_mps2.end());
  if (decision.status == DecisionStatus::none || *worst <= decision.max_abs_error_mps2)
    return decision;
  const auto axis = static_cast<std::size_t>(worst - error_mps2.begin());
  return decide(decision.limit_mps2, *worst, calibration.after.heldout_pose_rms_mps2[axis]);
}

Result<void> write_results(const CalibrationJob& job, const CalibrationOutcome& outcome,
                           OutputFolder& folder) {
  Provenance provenance = job.provenance;
  provenance.created_utc = issue_time_utc();
  const std::string result = file_text(result_json(outcome.calibration, provenance));
  if (auto done = folder.write("result.json", result); !done) return done;
  const CertificateInput certificate{
      .description = job.description,
      .calibration = outcome.calibration,
      .provenance = provenance,
      .verification = outcome.verification ? &*outcome.verification : nullptr,
      .events = job.events,
      .laboratory = job.style.laboratory,
      .language = job.style.language,
      .result_sha256 = sha256(result),
      .started_utc = job.started_utc,
      .finished_utc = job.finished_utc,
      .signing = job.style.signing ? &*job.style.signing : nullptr};
  if (auto done = write_certificate(certificate, folder); !done) return done;
  if (outcome.verification) {
    const Json json = evaluation_json(*outcome.verification, 0, job.description.limits, provenance);
    if (auto done = folder.write("evaluation.json", file_text(json)); !done) return done;
  }
  const Plan separation = separation_plan(job, outcome.calibration.diagnosis);
  if (!separation.steps.empty()) {
    if (auto done = folder.write("separate.csv", to_csv(separation)); !done) return done;
  }
  return folder.publish();
}

}  // namespace

Result<void> add_own_effects(const std::filesystem::path& path, CalibrationJob& job) {
  if (path.empty()) return {};
  auto effects = own_effects_for(path, job.description.reference_C, job.run.samples);
  if (!effects) return fail(effects.error());
  auto hash = sha256_of_file(path);
  if (!hash) return fail(hash.error());
  job.provenance.input_sha256.emplace_back(path.string(), *std::move(hash));
  job.own_effects = *std::move(effects);
  return {};
}

Calibration calibrate_job(const CalibrationJob& job) {
  return calibrate(
      {.run = job.run,
       .static_record = job.static_record.size() == 0 ? nullptr : &job.static_record,
       .description = job.description},
      {.seed = job.provenance.seed, .own_effects = job.own_effects, .reach = job.reach});
}

Result<CalibrationJob> job_from_files(const CalibrationFiles& files, std::uint64_t seed) {
  CalibrationJob job;
  job.source = files.samples.string();
  job.provenance.seed = seed;
  auto description = read_run_description(files.config);
  if (!description) return fail(description.error());
  job.description = *std::move(description);
  job.provenance.dut = job.description.dut;
  const CsvOptions rows{.skip_bad_rows = files.skip_bad_rows};
  Result<MeasurementSet> run;
  Result<StaticRecord> record;
  std::vector<std::filesystem::path> inputs = {files.samples};
  if (!files.static_record.empty()) inputs.push_back(files.static_record);
  inputs.push_back(files.config);
  std::vector<Result<std::string>> hashes(inputs.size());
  const std::vector<std::function<void()>> readings = {
      [&] { run = read_samples(files.samples, rows); },
      [&] {
        if (!files.static_record.empty()) record = read_static(files.static_record, rows);
      },
      [&] { std::transform(inputs.begin(), inputs.end(), hashes.begin(), sha256_of_file); },
  };
  parallel_for(readings.size(), [&](std::size_t k) { readings[k](); });
  if (!run) return fail(run.error());
  if (!record) return fail(record.error());
  if (auto good = check_clock(run->samples, job.source); !good) return fail(good.error());
  job.run = *std::move(run);
  job.static_record = std::move(record->samples);
  job.run.skipped_rows += record->skipped_rows;
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    if (!hashes[k]) return fail(hashes[k].error());
    job.provenance.input_sha256.emplace_back(inputs[k].string(), *std::move(hashes[k]));
  }
  return job;
}

Result<CalibrationJob> job_from_database(const std::filesystem::path& database, storage::RunId run,
                                         std::uint64_t seed) {
  CalibrationJob job;
  job.source = fmt::format("{}, run {}", database.string(), run);
  job.provenance.seed = seed;
  const auto store = storage::RunStore::open_read_only(database);
  if (!store) return fail(store.error());
  auto stored = store->load(run);
  if (!stored) return fail(stored.error());
  const storage::RunSummary& summary = stored->summary;
  auto description =
      parse_run_description(summary.header.config_toml, job.source + ", stored configuration");
  if (!description) return fail(description.error());
  job.description = *std::move(description);
  job.description.dut.serial = summary.header.serial;
  job.description.goes_as_commanded = true;  // the drive is sent to absolute positions
  job.provenance.dut = job.description.dut;
  if (const auto rig = parse_rig_description(summary.header.config_toml, job.source); rig)
    job.reach = reach_of(*rig);
  job.started_utc = summary.header.started_utc;
  job.finished_utc = summary.finished_utc;
  job.provenance.chain_head = summary.chain_head;
  job.run = std::move(stored->grid);
  job.static_record = std::move(stored->soak);
  job.verification = std::move(stored->verification);
  for (const storage::EventRecord& event : stored->events) {
    job.events.push_back({.t_s = event.t_s, .kind = event.kind, .text = event.text});
  }
  const double end_s = job.events.empty() ? 0 : job.events.back().t_s;
  for (const std::string& column : stored->left_out) {
    job.events.push_back(
        {.t_s = end_s, .kind = "left out", .text = column + ": not recorded throughout"});
  }
  if (summary.state != storage::RunState::finished) {
    job.events.push_back({.t_s = end_s,
                          .kind = kIncomplete,
                          .text = fmt::format("the run is not finished: {} after {} poses",
                                              storage::to_string(summary.state), summary.poses)});
  }
  auto hash = sha256_of_file(database);
  if (!hash) return fail(hash.error());
  job.provenance.input_sha256.emplace_back(database.string(), *std::move(hash));
  return job;
}

Result<CalibrationOutcome> perform(const CalibrationJob& job, const std::filesystem::path& out) {
  if (job.run.poses.empty()) return fail(ErrorCode::input, job.source + ": holds no pose");
  if (auto good = check_on_scale(job); !good) return fail(good.error());
  auto folder = OutputFolder::prepare(out);
  if (!folder) return fail(folder.error());

  CalibrationOutcome outcome;
  outcome.calibration = calibrate_job(job);
  const Calibration& calibration = outcome.calibration;
  if (auto good = check_observable(calibration.observability, job.source, job.run.poses.size());
      !good) {
    return fail(good.error());
  }
  if (auto good = check_responsive(calibration, job.source); !good) {
    return fail(good.error());
  }
  if (!job.verification.poses.empty()) {
    outcome.verification = evaluate(certified_model(calibration, job.own_effects), job.verification,
                                    job.description, BetweenSets::nowhere);
    outcome.calibration.decision = with_fresh_poses(calibration, *outcome.verification);
  }
  outcome.calibration.decision = stated_decision(calibration.decision, job.events);

  if (auto done = write_results(job, outcome, *folder); !done) return fail(done.error());
  if (separating_steps(outcome.calibration.diagnosis, 1).empty()) {
    std::error_code ignored;  // of an earlier calibration, when there is one
    std::filesystem::remove(out / "separate.csv", ignored);
  }

  outcome.exit_code =
      exceeds_limits(outcome, job.description.limits) ? ExitCode::limits_exceeded : ExitCode::done;
  outcome.summary = summary(job.description, calibration, outcome.verification);
  return outcome;
}

}  // namespace plumbline::app
