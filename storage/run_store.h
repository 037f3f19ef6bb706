// Runs in an SQLite file: what was measured, as it arrived; one durable commit per pose.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::storage {

using RunId = long long;

enum class PoseKind { soak, grid, verification };
enum class RunState { running, finished, stopped, failed };
const char* to_string(PoseKind kind);
const char* to_string(RunState state);

/// What is known when a run starts.
struct RunHeader {
  std::string serial;
  std::string program_version;
  std::string config_toml;  ///< rig.toml as it was read
  std::string plan_csv;     ///< the plan as it was printed
  std::string started_utc;  ///< ISO 8601
  double rate_hz = 0;
  Adc adc;  ///< turns stored codes into volts
};

struct RunSummary {
  RunId id = 0;
  RunHeader header;
  RunState state = RunState::running;
  std::string finished_utc;
  std::string chain_head;  ///< last link of the hash chain (hash_chain.h), hexadecimal
  long long poses = 0;
  long long samples = 0;
};

/// One covariate value on the run's clock.
struct StoredCovariate {
  std::string name;
  double t_s = 0;
  double value = 0;
};

/// One visit, complete: commanded and read-back angles and the samples as they arrived.
struct PoseRecord {
  long long ordinal = 0;  ///< position in the plan; unique within the run
  PoseKind kind = PoseKind::grid;
  double delta_deg = 0;  ///< commanded
  double h_deg = 0;
  double delta_enc_deg = 0;  ///< read back while sampling
  double h_enc_deg = 0;
  double settle_s = 0;         ///< from in-position to the first accepted sample
  bool settle_capped = false;  ///< the hard cap ended the settling
  int approach = 0;            ///< direction of the last δ motion: −1, +1; 0 = none so far
  std::vector<RawSample> samples;
  std::vector<StoredCovariate> covariates;
};

/// Whose rig a run was measured with; empty texts: not stated by the drive or the node.
struct RigIdentity {
  std::string drive;
  std::string node;
};

struct EventRecord {
  double t_s = 0;
  std::string utc;
  std::string kind;  ///< state, fault, retry, settle_cap, loss …
  std::string text;
};

/// What a look at the hash chain of one run says; no faults: nothing was changed.
struct ChainReport {
  RunId run = 0;
  long long poses = 0;
  std::string head;  ///< as stored, hexadecimal
  std::vector<std::string> faults;
};

/// A run as it is handed to the engine: volts, times and the columns of a measurement file.
///
/// Poses are numbered 0, 1, 2 … within their set in the order of the visits. A covariate is
/// recorded slower than the samples: a sample gets the last reading of the run that is at most 60 s
/// old, else the next one within 60 s. A quantity that leaves a sample of a set without such a
/// reading gives no column there and is named in `left_out`.
struct StoredRun {
  RunSummary summary;
  SampleTable soak;  ///< static record; empty when the plan had none
  MeasurementSet grid;
  MeasurementSet verification;  ///< poses empty when the plan had none
  std::vector<EventRecord> events;
  std::vector<std::string> left_out;  ///< "rh_pct (grid)"
};

/// The only writing connection. Not thread safe: one owner.
///
/// Failures while writing are ErrorCode::storage and leave the database as it was before the call.
/// A file that is missing, foreign, damaged or of a newer program is ErrorCode::input, and so is
/// everything that fails on a read-only store.
class RunStore {
 public:
  /// Creates the file and its schema when absent; migrates an older schema; refuses a newer one.
  static Result<RunStore> open(const std::filesystem::path& file);
  /// Read-only; the file must exist and be ours.
  static Result<RunStore> open_read_only(const std::filesystem::path& file);
  RunStore(RunStore&&) noexcept;
  RunStore& operator=(RunStore&&) noexcept;
  ~RunStore();

  Result<RunId> create_run(const RunHeader& header);
  /// Durable when it returns: pose, samples and covariates in one transaction. Refused (rig) when
  /// it has no sample or its time does not go on after what the run holds already; refused
  /// (storage) when its ordinal is stored already.
  Result<void> commit_pose(RunId run, const PoseRecord& pose);
  Result<void> add_event(RunId run, const EventRecord& event);
  /// Takes a committed pose out of the run: it stays stored, but is neither loaded nor counted. Its
  /// step may be measured again under another ordinal. An event "suspect" whose text holds `why`
  /// comes before it: check_chain() asks for one.
  Result<void> suspect_pose(RunId run, long long ordinal, const std::string& why);
  /// Once per run.
  Result<void> set_identity(RunId run, const RigIdentity& identity);
  /// Empty when it has not been set.
  Result<std::optional<RigIdentity>> identity(RunId run) const;
  /// Sets the state; RunState::running with an empty time reopens a run that is resumed.
  Result<void> finish_run(RunId run, RunState state, const std::string& finished_utc);

  Result<std::vector<RunSummary>> runs() const;
  Result<StoredRun> load(RunId run) const;
  /// The poses as they were committed, in the order of the visits; suspect ones left out.
  Result<std::vector<PoseRecord>> poses(RunId run) const;
  /// Ordinals of the suspect ones, ascending.
  Result<std::vector<long long>> suspect_poses(RunId run) const;
  /// What was noted during the run, oldest first.
  Result<std::vector<EventRecord>> events(RunId run) const;
  /// Looks for changed, removed and inserted poses.
  Result<ChainReport> check_chain(RunId run) const;
  /// Runs that were recorded and are not there any more.
  Result<std::vector<RunId>> removed_runs() const;
  /// Ordinals of the committed poses that are not suspect, ascending.
  Result<std::vector<long long>> committed_poses(RunId run) const;

 private:
  struct Impl;
  explicit RunStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumbline::storage
