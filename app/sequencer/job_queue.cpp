#include "app/sequencer/job_queue.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "app/io/read_file.h"
#include "rig/strict_toml.h"
#include "rig/toml.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

/// Tables are merged, everything else is replaced.
void merge(toml::table& into, const toml::table& from) {
  for (const auto& [key, value] : from) {
    toml::table* mine = into[key].as_table();
    const toml::table* theirs = value.as_table();
    if (mine != nullptr && theirs != nullptr) {
      merge(*mine, *theirs);
    } else {
      into.insert_or_assign(key, value);
    }
  }
}

/// The text of the configuration with the job's own settings in it.
Result<std::string> configured(const std::string& config, const fs::path& config_file,
                               const toml::table* set) {
  if (set == nullptr || set->empty()) return config;
  try {
    toml::table table = toml::parse(config, config_file.string());
    merge(table, *set);
    std::ostringstream text;
    text << table << "\n";
    return text.str();
  } catch (const toml::parse_error& error) {
    return fail(ErrorCode::input, fmt::format("{}: {}", config_file.string(), error.description()));
  }
}

std::optional<WaitCondition> read_wait(rig::StrictTable& job) {
  if (!job.has("wait_for")) return std::nullopt;
  rig::StrictTable table = job.table("wait_for");
  WaitCondition wait;
  wait.column = table.text("column");
  wait.min = table.number("min");
  wait.max = table.number("max");
  wait.hold_s = table.number_or("hold_s", wait.hold_s, {0, 1e6});
  wait.limit_s = table.number_or("limit_s", wait.limit_s, {0, 1e7});
  if (!(wait.min < wait.max)) table.refuse("max", "must be above min");
  return wait;
}

bool is_known_column(const std::string& column, const rig::SensorConfig& sensor) {
  return column == "temp_C" ||
         std::any_of(sensor.covariates.begin(), sensor.covariates.end(),
                     [&](const rig::CovariateSignal& signal) { return signal.column == column; });
}

}  // namespace

Result<JobQueue> read_job_queue(const fs::path& file) {
  auto parsed = rig::StrictFile::read(file);
  if (!parsed) return fail(parsed.error());
  // The values of `set` belong to the configuration, which is read strictly when they are in it.
  const toml::table raw = toml::parse(parsed->source());
  const toml::array* raw_jobs = raw["job"].as_array();
  rig::StrictTable root = parsed->root();
  const fs::path beside = file.parent_path();
  const fs::path config_file = beside / root.text("config");
  JobQueue queue;
  queue.database = beside / root.text("database");
  queue.out = beside / root.text("out");
  queue.hook = root.text_or("hook", "");
  queue.stop_on_fault = root.choice_or("on_fault", "stop", {"stop", "next"}) == "stop";
  const auto config = read_file(config_file);
  if (!config) return fail(config.error());

  const std::vector<std::string> actions = {"record", "calibrate", "verify"};
  std::set<std::string> names;
  std::set<std::string> calibrated;
  std::size_t index = 0;
  for (rig::StrictTable& table : root.tables("job")) {
    Job job;
    job.name = table.text("name");
    if (job.name.empty() || job.name.find('/') != std::string::npos || job.name.front() == '.') {
      table.refuse("name", "must be the name of a folder");
    }
    const std::string serial = table.text("serial");
    const std::string action = table.choice_or("action", "calibrate", actions);
    job.action =
        static_cast<JobAction>(std::find(actions.begin(), actions.end(), action) - actions.begin());
    job.against = table.text_or("against", "");
    const auto repeat = table.integer_or("repeat", 1, {1, 10000});
    job.wait_for = read_wait(table);
    const toml::table* set = nullptr;
    if (table.has("set") && raw_jobs != nullptr) {
      const toml::table* raw_job = (*raw_jobs)[index].as_table();
      set = raw_job == nullptr ? nullptr : (*raw_job)["set"].as_table();
      if (set == nullptr) table.refuse("set", "must be a table");
      table.leave("set");
    }
    ++index;
    auto text = configured(*config, config_file, set);
    if (!text) return fail(text.error());
    auto rig =
        parse_rig_description(*text, fmt::format("{}, job {}", config_file.string(), job.name));
    if (!rig) return fail(rig.error());
    job.rig = *std::move(rig);
    job.rig.run.dut.serial = serial;
    if (job.wait_for && !is_known_column(job.wait_for->column, job.rig.sensor)) {
      table.refuse("wait_for", fmt::format("column {} is not recorded", job.wait_for->column));
    }
    if (job.action == JobAction::verify && !calibrated.contains(job.against)) {
      table.refuse("against", "must name a calibrate job before this one");
    }
    const std::string name = job.name;
    for (int i = 1; i <= repeat; ++i) {
      if (repeat > 1) job.name = fmt::format("{}-{}", name, i);
      if (!names.insert(job.name).second) table.refuse("name", "is there twice: " + job.name);
      if (job.action == JobAction::calibrate) calibrated.insert(job.name);
      queue.jobs.push_back(job);
    }
  }
  if (auto done = parsed->finish(); !done) return fail(done.error());
  if (queue.jobs.empty()) {
    return fail(ErrorCode::input, fmt::format("{}: there is no [[job]]", file.string()));
  }
  return queue;
}

double planned_s(const Job& job) {
  const RigDescription& rig = job.rig;
  return time_plan(make_plan(rig.run.grid, rig.plan, rig.sensor.rate_hz),
                   {rig.head.speed_deg_s, rig.head.acceleration_deg_s2}, rig.sensor.rate_hz,
                   shortest_settling_s(rig.settling, rig.sensor.rate_hz))
      .total_s();
}

}  // namespace plumbline::app
