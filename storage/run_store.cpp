#include "storage/run_store.h"

#include <fmt/format.h>

#include <algorithm>

#include "storage/database.h"
#include "storage/hash_chain.h"
#include "storage/run_loader.h"
#include "storage/sample_blob.h"
#include "storage/schema.h"

namespace plumbline::storage {

namespace fs = std::filesystem;

struct RunStore::Impl {
  std::unique_ptr<Database> database;
};

const char* to_string(PoseKind kind) {
  switch (kind) {
    case PoseKind::soak:
      return "soak";
    case PoseKind::grid:
      return "grid";
    case PoseKind::verification:
      return "verification";
  }
  return "";
}

const char* to_string(RunState state) {
  switch (state) {
    case RunState::running:
      return "running";
    case RunState::finished:
      return "finished";
    case RunState::stopped:
      return "stopped";
    case RunState::failed:
      return "failed";
  }
  return "";
}

namespace {

/// Says what was being done when the database failed.
tl::unexpected<Error> while_doing(Error error, const std::string& what) {
  error.message += " (" + what + ")";
  return fail(std::move(error));
}

/// A wrong path is a wrong argument, whatever SQLite makes of it.
Result<void> check_path(const fs::path& file, bool must_exist) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  const auto refuse = [&](const char* reason) {
    return fail(ErrorCode::input, file.string() + ": " + reason);
  };
  if (fs::is_directory(status)) return refuse("is a folder, not a database file");
  if (fs::exists(status)) return {};
  if (must_exist) return refuse("there is no such database file");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, error)) {
    return refuse("the folder does not exist; create it first");
  }
  return {};
}

/// Time must go on within the pose and after everything stored before: the engine orders by it.
Result<void> check_pose(const Database& database, RunId run, const PoseRecord& pose) {
  const auto refuse = [&](ErrorCode code, const std::string& reason) {
    return fail(code, fmt::format("{}: run {}, pose {}: {}", database.file().string(), run,
                                  pose.ordinal, reason));
  };
  if (pose.samples.empty()) return refuse(ErrorCode::rig, "has no sample");
  bool stored = false;
  double last_t_s = -std::numeric_limits<double>::infinity();
  auto done = database.each(
      "SELECT ordinal = ?2, last_t_s FROM pose WHERE run = ?1",
      [&](const Statement& row) {
        stored = stored || row.integer(0) != 0;
        last_t_s = std::max(last_t_s, row.real(1));
      },
      run, pose.ordinal);
  if (!done) return done;
  if (stored) return refuse(ErrorCode::storage, "is already stored");
  for (const RawSample& sample : pose.samples) {
    if (!(sample.t_s > last_t_s)) {
      return refuse(ErrorCode::rig, fmt::format("sample {} at {} s is not later than the one "
                                                "before it at {} s; has the node restarted?",
                                                sample.counter, sample.t_s, last_t_s));
    }
    last_t_s = sample.t_s;
  }
  return {};
}

/// The link for a pose that has just been inserted; part of its transaction.
Result<void> extend_chain(const Database& database, RunId run, long long pose_id,
                          const PoseRecord& pose) {
  Hash head{};
  auto done = database.each(
      "SELECT chain_head FROM run WHERE id = ?1",
      [&](const Statement& row) {
        const Bytes stored = row.bytes(0);
        std::copy_n(stored.begin(), std::min(stored.size(), head.size()), head.begin());
      },
      run);
  if (!done) return done;
  head = next_link(head, pose);
  done = database.run("INSERT INTO link (pose, run, hash) VALUES (?1, ?2, ?3)", pose_id, run,
                      Bytes(head));
  if (!done) return done;
  return database.run("UPDATE run SET chain_head = ?2 WHERE id = ?1", run, Bytes(head));
}

Result<void> insert_pose(const Database& database, RunId run, const PoseRecord& pose) {
  auto transaction = Transaction::begin(database, Transaction::Kind::writing);
  if (!transaction) return fail(transaction.error());
  if (auto fits = check_pose(database, run, pose); !fits) return fits;
  auto done = database.run(
      "INSERT INTO pose (run, ordinal, kind, delta_deg, h_deg, delta_enc_deg, h_enc_deg, settle_s,"
      " settle_capped, approach, first_t_s, last_t_s, sample_count, samples)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14)",
      run, pose.ordinal, to_string(pose.kind), pose.delta_deg, pose.h_deg, pose.delta_enc_deg,
      pose.h_enc_deg, pose.settle_s, pose.settle_capped, pose.approach, pose.samples.front().t_s,
      pose.samples.back().t_s, pose.samples.size(), Bytes(pack_samples(pose.samples)));
  if (!done) return done;

  const long long pose_id = database.last_insert_id();
  auto insert = database.prepare("INSERT INTO covariate VALUES (?1, ?2, ?3, ?4, ?5)");
  if (!insert) return fail(insert.error());
  for (std::size_t i = 0; i < pose.covariates.size(); ++i) {
    const StoredCovariate& covariate = pose.covariates[i];
    const auto end =
        insert->bind(pose_id, i, covariate.name, covariate.t_s, covariate.value).step();
    if (!end) return fail(end.error());
  }
  if (done = extend_chain(database, run, pose_id, pose); !done) return done;
  return transaction->commit();
}

Result<std::vector<long long>> ordinals(const Database& database, RunId run, bool suspect) {
  std::vector<long long> found;
  const auto done = database.each(
      "SELECT ordinal FROM pose WHERE run = ?1 AND (id IN (SELECT pose FROM suspect)) = ?2"
      " ORDER BY ordinal",
      [&](const Statement& row) { found.push_back(row.integer(0)); }, run, suspect);
  if (!done) return fail(done.error());
  return found;
}

Result<RunId> create(const Database& database, const RunHeader& header) {
  auto transaction = Transaction::begin(database, Transaction::Kind::writing);
  if (!transaction) return fail(transaction.error());
  auto done = database.run(
      "INSERT INTO run (serial, program_version, started_utc, rate_hz, adc_bits, adc_min_V,"
      " adc_max_V, state, finished_utc, config_toml, plan_csv)"
      " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, '', ?9, ?10)",
      header.serial, header.program_version, header.started_utc, header.rate_hz, header.adc.bits,
      header.adc.min_V, header.adc.max_V, to_string(RunState::running), header.config_toml,
      header.plan_csv);
  if (!done) return fail(done.error());
  const RunId run = database.last_insert_id();
  done = database.run("UPDATE run SET chain_head = ?2 WHERE id = ?1", run,
                      Bytes(first_link(run, header)));
  if (!done) return fail(done.error());
  if (done = transaction->commit(); !done) return fail(done.error());
  return run;
}

}  // namespace

RunStore::RunStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RunStore::RunStore(RunStore&&) noexcept = default;
RunStore& RunStore::operator=(RunStore&&) noexcept = default;
RunStore::~RunStore() = default;

Result<RunStore> RunStore::open(const fs::path& file) {
  if (auto path = check_path(file, false); !path) return fail(path.error());
  auto database = Database::open(file, OpenMode::create);
  if (!database) return fail(database.error());
  if (auto done = migrate(**database); !done) return fail(done.error());
  return RunStore(std::make_unique<Impl>(Impl{std::move(*database)}));
}

Result<RunStore> RunStore::open_read_only(const fs::path& file) {
  if (auto path = check_path(file, true); !path) return fail(path.error());
  auto database = Database::open(file, OpenMode::read_only);
  if (!database) return fail(database.error());
  if (auto done = check_schema(**database); !done) return fail(done.error());
  return RunStore(std::make_unique<Impl>(Impl{std::move(*database)}));
}

Result<RunId> RunStore::create_run(const RunHeader& header) {
  const auto done = create(*impl_->database, header);
  if (!done) return while_doing(done.error(), "while creating a run");
  return *done;
}

Result<void> RunStore::commit_pose(RunId run, const PoseRecord& pose) {
  auto done = insert_pose(*impl_->database, run, pose);
  if (!done && done.error().code == ErrorCode::storage) {
    return while_doing(done.error(), fmt::format("while storing pose {} of run {}; all poses "
                                                 "before it are safe",
                                                 pose.ordinal, run));
  }
  return done;
}

Result<void> RunStore::add_event(RunId run, const EventRecord& event) {
  const auto done = impl_->database->run(
      "INSERT INTO event (run, t_s, utc, kind, text) VALUES (?1, ?2, ?3, ?4, ?5)", run, event.t_s,
      event.utc, event.kind, event.text);
  if (!done) return while_doing(done.error(), fmt::format("while storing an event of run {}", run));
  return {};
}

Result<void> RunStore::suspect_pose(RunId run, long long ordinal, const std::string& why) {
  const auto done = impl_->database->run(
      "INSERT INTO suspect (pose, why) SELECT id, ?3 FROM pose WHERE run = ?1 AND ordinal = ?2",
      run, ordinal, why);
  if (!done) {
    return while_doing(done.error(),
                       fmt::format("while taking pose {} out of run {}", ordinal, run));
  }
  return {};
}

Result<void> RunStore::set_identity(RunId run, const RigIdentity& identity) {
  const auto done =
      impl_->database->run("INSERT INTO identity (run, drive, node) VALUES (?1, ?2, ?3)", run,
                           identity.drive, identity.node);
  if (!done) return while_doing(done.error(), fmt::format("while storing the rig of run {}", run));
  return {};
}

Result<std::optional<RigIdentity>> RunStore::identity(RunId run) const {
  std::optional<RigIdentity> identity;
  const auto done = impl_->database->each(
      "SELECT drive, node FROM identity WHERE run = ?1",
      [&](const Statement& row) {
        identity = RigIdentity{row.text(0), row.text(1)};
      },
      run);
  if (!done) return fail(done.error());
  return identity;
}

Result<void> RunStore::finish_run(RunId run, RunState state, const std::string& finished_utc) {
  bool found = false;
  const auto done = impl_->database->each(
      "UPDATE run SET state = ?2, finished_utc = ?3 WHERE id = ?1 RETURNING id",
      [&](const Statement&) { found = true; }, run, to_string(state), finished_utc);
  if (!done) return while_doing(done.error(), fmt::format("while closing run {}", run));
  if (!found) return impl_->database->failure(fmt::format("there is no run {} to close", run));
  return {};
}

Result<std::vector<RunSummary>> RunStore::runs() const { return list_runs(*impl_->database); }

Result<StoredRun> RunStore::load(RunId run) const { return load_run(*impl_->database, run); }

Result<std::vector<EventRecord>> RunStore::events(RunId run) const {
  return list_events(*impl_->database, run);
}

Result<ChainReport> RunStore::check_chain(RunId run) const {
  return storage::check_chain(*impl_->database, run);
}

Result<std::vector<RunId>> RunStore::removed_runs() const {
  return storage::removed_runs(*impl_->database);
}

Result<std::vector<PoseRecord>> RunStore::poses(RunId run) const {
  std::vector<PoseRecord> records;
  const auto done = each_pose(*impl_->database, run, [&](const StoredPose& pose) {
    if (!pose.suspect) records.push_back(pose.record);
  });
  if (!done) return fail(done.error());
  return records;
}

Result<std::vector<long long>> RunStore::committed_poses(RunId run) const {
  return ordinals(*impl_->database, run, false);
}

Result<std::vector<long long>> RunStore::suspect_poses(RunId run) const {
  return ordinals(*impl_->database, run, true);
}

}  // namespace plumbline::storage
