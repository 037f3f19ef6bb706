// One calibration from its inputs to its output folder. Files and stored runs take the same way, so
// that equal data give equal results; `calibrate`, `run` and `dry-run` end here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/certificate/style.h"
#include "app/config/own_effects.h"
#include "app/exit_code.h"
#include "app/provenance.h"
#include "estimator/calibrate.h"
#include "storage/run_store.h"

namespace plumbline::app {

/// Everything that a calibration needs, wherever it was read.
struct CalibrationJob {
  RunDescription description;
  MeasurementSet run;
  SampleTable static_record;    ///< no rows: none
  MeasurementSet verification;  ///< fresh poses off the grid; no poses: none
  std::vector<CertificateEvent> events;
  Provenance provenance;    ///< unit, input hashes, seed
  std::string source;       ///< what was read, for messages
  std::string started_utc;  ///< of a stored run; empty: not known
  std::string finished_utc;
  CertificateStyle style;
  OwnEffects own_effects;          ///< of the user, searched for like the listed ones
  std::optional<HeadReach> reach;  ///< for suggested poses; nothing: what the run visited
};

struct CalibrationFiles {
  std::filesystem::path samples;
  std::filesystem::path static_record;  ///< empty: none
  std::filesystem::path config;
  bool skip_bad_rows = false;
};

Result<CalibrationJob> job_from_files(const CalibrationFiles& files, std::uint64_t seed);
/// The run is described by the configuration stored with it.
Result<CalibrationJob> job_from_database(const std::filesystem::path& database, storage::RunId run,
                                         std::uint64_t seed);

/// Reads effects that a user described (own_effects.h); an empty path: none. Refuses those that
/// need columns which the job's data do not have.
Result<void> add_own_effects(const std::filesystem::path& path, CalibrationJob& job);

/// The engine alone, nothing written.
Calibration calibrate_job(const CalibrationJob& job);

struct CalibrationOutcome {
  Calibration calibration;
  std::optional<Evaluation> verification;
  ExitCode exit_code = ExitCode::done;  ///< done or limits_exceeded
  std::string summary;                  ///< for a person; the last line says what came out
};

/// Calibrates and writes result.json, the certificate in its forms, with verification poses
/// evaluation.json and, where further poses would tell an effect from another, separate.csv
/// (a plan: the run once more with those poses) into `out`: all of them or, on failure, none.
/// Refuses poses that do not determine the twelve parameters, naming the unobservable direction.
Result<CalibrationOutcome> perform(const CalibrationJob& job, const std::filesystem::path& out);

}  // namespace plumbline::app
