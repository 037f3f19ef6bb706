#include "storage/schema.h"

#include <fmt/format.h>

#include <array>
#include <cassert>

#include "storage/hash_chain.h"

namespace plumbline::storage {

namespace {

// Version 1. Measured rows are never changed: triggers refuse UPDATE and DELETE, so a slip of the
// hand in a database browser cannot falsify a calibration. The BLOB stands last in its row, so that
// counting and listing never touch the pages it fills.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE run (
  id              INTEGER PRIMARY KEY AUTOINCREMENT,
  serial          TEXT NOT NULL,
  program_version TEXT NOT NULL,
  started_utc     TEXT NOT NULL,
  rate_hz         REAL NOT NULL,
  adc_bits        INTEGER NOT NULL,
  adc_min_V       REAL NOT NULL,
  adc_max_V       REAL NOT NULL,
  state           TEXT NOT NULL CHECK (state IN ('running', 'finished', 'stopped', 'failed')),
  finished_utc    TEXT NOT NULL,              -- '' while running
  config_toml     TEXT NOT NULL,
  plan_csv        TEXT NOT NULL
) STRICT;

CREATE TABLE pose (
  id            INTEGER PRIMARY KEY AUTOINCREMENT,   -- ascends in the order of the visits
  run           INTEGER NOT NULL REFERENCES run (id),
  ordinal       INTEGER NOT NULL,                    -- position in the plan
  kind          TEXT NOT NULL CHECK (kind IN ('soak', 'grid', 'verification')),
  delta_deg     REAL NOT NULL,
  h_deg         REAL NOT NULL,
  delta_enc_deg REAL NOT NULL,
  h_enc_deg     REAL NOT NULL,
  settle_s      REAL NOT NULL,
  settle_capped INTEGER NOT NULL CHECK (settle_capped IN (0, 1)),
  first_t_s     REAL NOT NULL,
  last_t_s      REAL NOT NULL CHECK (last_t_s >= first_t_s),
  sample_count  INTEGER NOT NULL CHECK (sample_count > 0),
  samples       BLOB NOT NULL CHECK (length(samples) = 37 * sample_count),  -- sample_blob.h
  UNIQUE (run, ordinal)
) STRICT;

CREATE TABLE covariate (
  pose     INTEGER NOT NULL REFERENCES pose (id),
  position INTEGER NOT NULL,                         -- order of arrival within the pose
  name     TEXT NOT NULL,
  t_s      REAL NOT NULL,
  value    REAL NOT NULL,
  PRIMARY KEY (pose, position)
) STRICT, WITHOUT ROWID;

CREATE TABLE event (
  id   INTEGER PRIMARY KEY AUTOINCREMENT,
  run  INTEGER NOT NULL REFERENCES run (id),
  t_s  REAL NOT NULL,
  utc  TEXT NOT NULL,
  kind TEXT NOT NULL,
  text TEXT NOT NULL
) STRICT;
CREATE INDEX event_run ON event (run);

CREATE TRIGGER run_is_kept BEFORE DELETE ON run
  BEGIN SELECT RAISE(ABORT, 'a recorded run is never deleted'); END;
CREATE TRIGGER run_header_is_fixed BEFORE UPDATE OF id, serial, program_version, started_utc, rate_hz,
    adc_bits, adc_min_V, adc_max_V, config_toml, plan_csv ON run
  BEGIN SELECT RAISE(ABORT, 'the description of a recorded run is never changed'); END;
CREATE TRIGGER pose_is_kept BEFORE DELETE ON pose
  BEGIN SELECT RAISE(ABORT, 'measured data are never deleted'); END;
CREATE TRIGGER pose_is_fixed BEFORE UPDATE ON pose
  BEGIN SELECT RAISE(ABORT, 'measured data are never changed'); END;
CREATE TRIGGER covariate_is_kept BEFORE DELETE ON covariate
  BEGIN SELECT RAISE(ABORT, 'measured data are never deleted'); END;
CREATE TRIGGER covariate_is_fixed BEFORE UPDATE ON covariate
  BEGIN SELECT RAISE(ABORT, 'measured data are never changed'); END;
CREATE TRIGGER event_is_kept BEFORE DELETE ON event
  BEGIN SELECT RAISE(ABORT, 'events are never deleted'); END;
CREATE TRIGGER event_is_fixed BEFORE UPDATE ON event
  BEGIN SELECT RAISE(ABORT, 'events are never changed'); END;
)sql";

// Version 2. The hash chain, the direction in which δ was approached, and whose drive and node a
// run was measured with, and poses that turned out to be measured at a wrong angle: they stay, but
// are not loaded, and their step is measured again.
constexpr const char* kVersion2 = R"sql(
ALTER TABLE run ADD COLUMN chain_head BLOB NOT NULL DEFAULT x'';   -- hash_chain.h
ALTER TABLE pose ADD COLUMN approach INTEGER NOT NULL DEFAULT 0 CHECK (approach IN (-1, 0, 1));

CREATE TABLE link (
  pose INTEGER PRIMARY KEY REFERENCES pose (id),
  run  INTEGER NOT NULL REFERENCES run (id),
  hash BLOB NOT NULL CHECK (length(hash) = 32)
) STRICT;
CREATE INDEX link_run ON link (run);
CREATE TRIGGER link_is_kept BEFORE DELETE ON link
  BEGIN SELECT RAISE(ABORT, 'the hash chain is never deleted'); END;
CREATE TRIGGER link_is_fixed BEFORE UPDATE ON link
  BEGIN SELECT RAISE(ABORT, 'the hash chain is never changed'); END;

CREATE TABLE suspect (
  pose INTEGER PRIMARY KEY REFERENCES pose (id),
  why  TEXT NOT NULL
) STRICT;
CREATE TRIGGER suspect_is_kept BEFORE DELETE ON suspect
  BEGIN SELECT RAISE(ABORT, 'a suspicion is never deleted'); END;
CREATE TRIGGER suspect_is_fixed BEFORE UPDATE ON suspect
  BEGIN SELECT RAISE(ABORT, 'a suspicion is never changed'); END;

CREATE TABLE identity (
  run   INTEGER PRIMARY KEY REFERENCES run (id),
  drive TEXT NOT NULL,                                -- '' when the drive does not say
  node  TEXT NOT NULL
) STRICT;
CREATE TRIGGER identity_is_kept BEFORE DELETE ON identity
  BEGIN SELECT RAISE(ABORT, 'the identity of the rig is never deleted'); END;
CREATE TRIGGER identity_is_fixed BEFORE UPDATE ON identity
  BEGIN SELECT RAISE(ABORT, 'the identity of the rig is never changed'); END;
)sql";

struct Identity {
  long long application_id = 0;
  long long version = 0;
  bool empty = false;
};

Result<Identity> identify(const Database& database) {
  const auto application_id = database.integer("PRAGMA application_id");
  if (!application_id) return fail(application_id.error());
  const auto version = database.integer("PRAGMA user_version");
  if (!version) return fail(version.error());
  const auto objects = database.integer("SELECT count(*) FROM sqlite_schema");
  if (!objects) return fail(objects.error());
  return Identity{*application_id, *version,
                  *application_id == 0 && *version == 0 && *objects == 0};
}

/// A file that is not ours or not of our time is a wrong argument, whatever it was opened for.
tl::unexpected<Error> refusal(const Database& database, const std::string& text) {
  return fail(ErrorCode::input, database.file().string() + ": " + text);
}

Result<void> check_ours(const Database& database, const Identity& identity, int current) {
  if (identity.application_id != kApplicationId) {
    return refusal(database, "is an SQLite database, but not one of plumbline");
  }
  if (identity.version > current) {
    return refusal(database,
                   fmt::format("was written by a newer plumbline (schema {}, this program knows "
                               "{}); use a program at least that new",
                               identity.version, current));
  }
  return {};
}

}  // namespace

std::span<const Migration> migrations() {
  static const std::array<Migration, 2> all{
      {{.to = 1, .script = kVersion1}, {.to = 2, .script = kVersion2, .fill = &link_older_runs}}};
  return all;
}

Result<void> migrate(const Database& database, std::span<const Migration> steps) {
  assert(!steps.empty());
  const int current = steps.back().to;
  // Looked at first without a lock: a foreign file must not even change its journal mode.
  auto identity = identify(database);
  if (!identity) return fail(identity.error());
  if (!identity->empty) {
    if (auto ours = check_ours(database, *identity, current); !ours) return ours;
  }
  if (auto done = database.make_durable(); !done) return done;
  if (identity->version == current) return {};

  auto transaction = Transaction::begin(database, Transaction::Kind::writing);
  if (!transaction) return fail(transaction.error());
  identity = identify(database);  // another process may have been faster
  if (!identity) return fail(identity.error());
  for (const Migration& step : steps) {
    if (step.to <= identity->version) continue;
    auto done = database.execute(step.script);
    if (done && step.fill != nullptr) done = step.fill(database);
    if (!done) {
      return fail(done.error().code,
                  fmt::format("{} (while migrating to schema {})", done.error().message, step.to));
    }
  }
  auto done = database.execute(
      fmt::format("PRAGMA application_id={}; PRAGMA user_version={}", kApplicationId, current));
  if (!done) return done;
  return transaction->commit();
}

Result<void> check_schema(const Database& database, std::span<const Migration> steps) {
  const auto identity = identify(database);
  if (!identity) return fail(identity.error());
  if (identity->empty) return refusal(database, "is empty, no run has been recorded in it");
  const int current = steps.back().to;
  if (auto ours = check_ours(database, *identity, current); !ours) return ours;
  if (identity->version < current) {
    return refusal(database,
                   fmt::format("has schema {} and this program reads {}; start a run with it once, "
                               "which brings it up to date",
                               identity->version, current));
  }
  return {};
}

}  // namespace plumbline::storage
