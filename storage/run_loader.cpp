#include "storage/run_loader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>

#include "storage/hash_chain.h"
#include "storage/sample_blob.h"

namespace plumbline::storage {

namespace {

/// How far in time a covariate reading speaks for samples. Longer than any move of the head, and
/// short enough that a thermometer which fell silent is noticed.
constexpr double kCovariateReach_s = 60;

constexpr const char* kSelectRuns = R"sql(
SELECT run.id, serial, program_version, config_toml, plan_csv, started_utc, rate_hz,
       adc_bits, adc_min_V, adc_max_V, state, finished_utc, chain_head,
       count(pose.id), coalesce(sum(pose.sample_count), 0)
FROM run LEFT JOIN pose ON pose.run = run.id AND pose.id NOT IN (SELECT pose FROM suspect)
WHERE ?1 = 0 OR run.id = ?1
GROUP BY run.id ORDER BY run.id)sql";

RunState state_from(const std::string& text) {
  for (const RunState state : {RunState::running, RunState::finished, RunState::stopped}) {
    if (text == to_string(state)) return state;
  }
  return RunState::failed;
}

RunSummary summary_from(const Statement& row) {
  RunSummary summary;
  summary.id = row.integer(0);
  summary.header.serial = row.text(1);
  summary.header.program_version = row.text(2);
  summary.header.config_toml = row.text(3);
  summary.header.plan_csv = row.text(4);
  summary.header.started_utc = row.text(5);
  summary.header.rate_hz = row.real(6);
  summary.header.adc.bits = static_cast<int>(row.integer(7));
  summary.header.adc.min_V = row.real(8);
  summary.header.adc.max_V = row.real(9);
  summary.state = state_from(row.text(10));
  summary.finished_utc = row.text(11);
  summary.chain_head = to_hex(row.bytes(12));
  summary.poses = row.integer(13);
  summary.samples = row.integer(14);
  return summary;
}

struct Reading {
  double t_s = 0;
  double value = 0;
};
/// Readings of the whole run by name, ascending in time.
using Readings = std::map<std::string, std::vector<Reading>>;

struct Visit {
  PoseKind kind = PoseKind::grid;
  double delta_deg = 0;
  double h_deg = 0;
  double delta_enc_deg = 0;
  double h_enc_deg = 0;
};

void append_samples(SampleTable& table, std::span<const RawSample> samples, const Adc& adc) {
  for (const RawSample& sample : samples) {
    table.t_s.push_back(sample.t_s);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      table.u_V[axis].push_back(adc.volts(sample.code[axis]));
    }
    table.temp_C.push_back(sample.temp_C);
  }
}

void append_pose(MeasurementSet& set, const Visit& visit, std::span<const RawSample> samples,
                 const Adc& adc) {
  Pose pose;
  pose.number = static_cast<long long>(set.poses.size());
  pose.delta_deg = visit.delta_deg;
  pose.h_deg = visit.h_deg;
  pose.first = set.samples.size();
  pose.count = samples.size();
  set.poses.push_back(pose);
  append_samples(set.samples, samples, adc);
  set.samples.delta_enc_deg.resize(set.samples.size(), visit.delta_enc_deg);
  set.samples.h_enc_deg.resize(set.samples.size(), visit.h_enc_deg);
}

/// The latest reading when it is fresh, else the next one when it is near; NaN when neither is.
double value_at(const std::vector<Reading>& readings, double t_s) {
  const auto next = std::upper_bound(readings.begin(), readings.end(), t_s,
                                     [](double t, const Reading& r) { return t < r.t_s; });
  if (next != readings.begin() && t_s - std::prev(next)->t_s <= kCovariateReach_s) {
    return std::prev(next)->value;
  }
  if (next != readings.end() && next->t_s - t_s <= kCovariateReach_s) return next->value;
  return std::nan("");
}

void add_covariates(SampleTable& table, const Readings& readings, const char* set_name,
                    std::vector<std::string>& left_out) {
  const auto unknown = [](double value) { return !std::isfinite(value); };
  if (std::any_of(table.temp_C.begin(), table.temp_C.end(), unknown)) {
    if (!std::all_of(table.temp_C.begin(), table.temp_C.end(), unknown)) {
      left_out.push_back(fmt::format("temp_C ({})", set_name));
    }
    table.temp_C.clear();
  }
  if (table.size() == 0) return;
  for (const auto& [name, series] : readings) {
    Covariate column{name, {}};
    column.value.reserve(table.size());
    for (const double t_s : table.t_s) column.value.push_back(value_at(series, t_s));
    if (std::any_of(column.value.begin(), column.value.end(), unknown)) {
      left_out.push_back(fmt::format("{} ({})", name, set_name));
    } else {
      table.covariates.push_back(std::move(column));
    }
  }
}

using Covariates = std::map<long long, std::vector<StoredCovariate>>;  ///< by pose id

Result<Covariates> read_covariates(const Database& database, RunId run) {
  Covariates covariates;
  auto done = database.each(
      "SELECT pose, name, t_s, value FROM covariate JOIN pose ON pose.id = covariate.pose"
      " WHERE pose.run = ?1 ORDER BY pose, position",
      [&](const Statement& row) {
        covariates[row.integer(0)].push_back({row.text(1), row.real(2), row.real(3)});
      },
      run);
  if (!done) return fail(done.error());
  return covariates;
}

Result<Readings> load_readings(const Database& database, RunId run) {
  Readings readings;
  auto done = database.each(
      "SELECT name, t_s, value FROM covariate JOIN pose ON pose.id = covariate.pose"
      " WHERE pose.run = ?1 ORDER BY pose.id, position",
      [&](const Statement& row) {
        readings[row.text(0)].push_back({row.real(1), row.real(2)});
      },
      run);
  if (!done) return fail(done.error());
  for (auto& [name, series] : readings) {
    std::stable_sort(series.begin(), series.end(),
                     [](const Reading& a, const Reading& b) { return a.t_s < b.t_s; });
  }
  return readings;
}

Result<void> load_poses(const Database& database, const Adc& adc, StoredRun& run) {
  double last_t_s = -std::numeric_limits<double>::infinity();
  long long disordered = -1;  // ordinal of the first pose whose clock went back
  auto done = database.each(
      "SELECT ordinal, kind, delta_deg, h_deg, delta_enc_deg, h_enc_deg, samples FROM pose"
      " WHERE run = ?1 AND id NOT IN (SELECT pose FROM suspect) ORDER BY id",
      [&](const Statement& row) {
        const Visit visit{pose_kind_from(row.text(1)), row.real(2), row.real(3), row.real(4),
                          row.real(5)};
        const std::vector<RawSample> samples = unpack_samples(row.bytes(6));
        for (const RawSample& sample : samples) {
          if (!(sample.t_s > last_t_s) && disordered < 0) disordered = row.integer(0);
          last_t_s = sample.t_s;
        }
        switch (visit.kind) {
          case PoseKind::soak:
            append_samples(run.soak, samples, adc);
            break;
          case PoseKind::grid:
            append_pose(run.grid, visit, samples, adc);
            break;
          case PoseKind::verification:
            append_pose(run.verification, visit, samples, adc);
            break;
        }
      },
      run.summary.id);
  if (!done) return done;
  if (disordered >= 0) {
    return database.failure(
        fmt::format("run {}: the samples of pose {} are not in time order; the "
                    "database has been changed from outside",
                    run.summary.id, disordered));
  }
  return {};
}

}  // namespace

PoseKind pose_kind_from(const std::string& text) {
  for (const PoseKind kind : {PoseKind::soak, PoseKind::grid}) {
    if (text == to_string(kind)) return kind;
  }
  return PoseKind::verification;
}

Result<std::vector<RunSummary>> list_runs(const Database& database) {
  std::vector<RunSummary> runs;
  auto done = database.each(
      kSelectRuns, [&](const Statement& row) { runs.push_back(summary_from(row)); }, 0);
  if (!done) return fail(done.error());
  return runs;
}

Result<void> each_pose(const Database& database, RunId run,
                       const std::function<void(const StoredPose&)>& use) {
  auto covariates = read_covariates(database, run);
  if (!covariates) return fail(covariates.error());
  return database.each(
      "SELECT pose.id, ordinal, kind, delta_deg, h_deg, delta_enc_deg, h_enc_deg, settle_s,"
      " settle_capped, approach, samples, coalesce(link.hash, x''),"
      " pose.id IN (SELECT pose FROM suspect), first_t_s, last_t_s, sample_count FROM pose"
      " LEFT JOIN link ON link.pose = pose.id WHERE pose.run = ?1 ORDER BY pose.id",
      [&](const Statement& row) {
        StoredPose pose;
        pose.id = row.integer(0);
        pose.record.ordinal = row.integer(1);
        pose.record.kind = pose_kind_from(row.text(2));
        pose.record.delta_deg = row.real(3);
        pose.record.h_deg = row.real(4);
        pose.record.delta_enc_deg = row.real(5);
        pose.record.h_enc_deg = row.real(6);
        pose.record.settle_s = row.real(7);
        pose.record.settle_capped = row.integer(8) != 0;
        pose.record.approach = static_cast<int>(row.integer(9));
        pose.record.samples = unpack_samples(row.bytes(10));
        pose.record.covariates = std::move((*covariates)[pose.id]);
        pose.link = to_hex(row.bytes(11));
        pose.suspect = row.integer(12) != 0;
        const std::vector<RawSample>& samples = pose.record.samples;
        pose.consistent = !samples.empty() && samples.front().t_s == row.real(13) &&
                          samples.back().t_s == row.real(14) &&
                          std::ssize(samples) == row.integer(15);
        use(pose);
      },
      run);
}

Result<std::vector<EventRecord>> list_events(const Database& database, RunId run) {
  std::vector<EventRecord> events;
  const auto done = database.each(
      "SELECT t_s, utc, kind, text FROM event WHERE run = ?1 ORDER BY id",
      [&](const Statement& row) {
        events.push_back({row.real(0), row.text(1), row.text(2), row.text(3)});
      },
      run);
  if (!done) return fail(done.error());
  return events;
}

Result<StoredRun> load_run(const Database& database, RunId run) {
  const auto snapshot = Transaction::begin(database, Transaction::Kind::reading);
  if (!snapshot) return fail(snapshot.error());

  StoredRun result;
  bool found = false;
  auto done = database.each(
      kSelectRuns,
      [&](const Statement& row) {
        result.summary = summary_from(row);
        found = true;
      },
      run);
  if (!done) return fail(done.error());
  if (!found) {
    return fail(ErrorCode::input, fmt::format("{}: there is no run {}; `plumbline runs` lists them",
                                              database.file().string(), run));
  }
  if (done = load_poses(database, result.summary.header.adc, result); !done) {
    return fail(done.error());
  }
  auto events = list_events(database, run);
  if (!events) return fail(events.error());
  result.events = *std::move(events);
  const auto readings = load_readings(database, run);
  if (!readings) return fail(readings.error());
  add_covariates(result.soak, *readings, "soak", result.left_out);
  add_covariates(result.grid.samples, *readings, "grid", result.left_out);
  add_covariates(result.verification.samples, *readings, "verification", result.left_out);
  return result;
}

}  // namespace plumbline::storage
