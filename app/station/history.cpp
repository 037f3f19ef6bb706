#include "app/station/history.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "app/io/read_file.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

constexpr int kDepth = 3;
constexpr std::size_t kMostResults = 20000;
constexpr std::uintmax_t kLargestResult = 16 << 20;

std::optional<double> number(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

PerAxis<double> three(const Json& list) {
  PerAxis<double> values{};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    values[i] = list.at(i).is_number() ? list.at(i).get<double>() : std::nan("");
  }
  return values;
}

std::vector<CertifiedParameter> parameters_of(const Json& triad) {
  std::vector<CertifiedParameter> parameters;
  for (const char* axis : kAxisName) {
    const Json& row = triad.at(axis);
    for (std::size_t j = 0; j < kAxisCount; ++j) {
      parameters.push_back({fmt::format("K_{}{}", axis, kAxisName[j]), "V/g",
                            row.at("K_V_per_g").at(j).get<double>(),
                            row.at("u_K_V_per_g").at(j).get<double>()});
    }
    parameters.push_back({fmt::format("U0_{}", axis), "V", row.at("U0_V").get<double>(),
                          row.at("u_U0_V").get<double>()});
  }
  return parameters;
}

/// Nothing when the file is not the result of a stored run.
std::optional<StoredResult> read_result(const fs::path& file) {
  std::error_code error;
  if (fs::file_size(file, error) > kLargestResult || error) return std::nullopt;
  const auto text = read_file(file);
  if (!text) return std::nullopt;
  try {
    const Json json = Json::parse(*text);
    StoredResult result;
    result.folder = file.parent_path();
    const Json& provenance = json.at("provenance");
    result.chain_head = provenance.value("chain_head", "");
    if (result.chain_head.empty() || !json.contains("final")) return std::nullopt;
    result.created_utc = provenance.value("created_utc", "");
    const Json& decision = json.at("decision");
    result.decision = decision.at("status").get<std::string>();
    result.limit_mps2 = number(decision, "limit_mps2");
    result.max_abs_error_mps2 = number(decision, "max_abs_error_mps2");
    result.u_mps2 = number(decision, "u_mps2");
    const Json& diagnosis = json.at("diagnosis");
    result.verdict = diagnosis.at("verdict").get<std::string>();
    result.reason = diagnosis.value("reason", "");
    for (const Json& effect : diagnosis.at("effects")) {
      result.effects.push_back(effect.at("id").get<std::string>());
    }
    result.before_mps2 = three(json.at("error").at("before").at("heldout_pose_rms"));
    result.after_mps2 = three(json.at("error").at("after").at("heldout_pose_rms"));
    result.parameters = parameters_of(json.at("final").at("batch_ls"));
    return result;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

bool is_golden(const HistoryOptions& options, const HistoryRun& entry) {
  return !options.golden.empty() && entry.run.header.serial == options.golden;
}

Json optional_json(const std::optional<double>& value) {
  return value ? json_number(*value) : Json();
}

/// One parameter over a series of runs.
Json series_json(const std::vector<const HistoryRun*>& series, std::size_t index,
                 const Tolerance& tolerance) {
  std::vector<double> values;
  Json points = Json::array();
  for (const HistoryRun* entry : series) {
    const CertifiedParameter& parameter = entry->result->parameters[index];
    values.push_back(parameter.value);
    points.push_back({{"run", entry->run.id},
                      {"serial", entry->run.header.serial},
                      {"utc", entry->run.header.started_utc},
                      {"value", json_number(parameter.value)},
                      {"u", json_number(parameter.u)}});
  }
  Json json = {{"points", std::move(points)}};
  if (const auto chart = control_chart(values)) {
    json["chart"] = {{"mean", json_number(chart->mean)},
                     {"lower", json_number(chart->lower)},
                     {"upper", json_number(chart->upper)},
                     {"mean_range", json_number(chart->mean_range)},
                     {"upper_range", json_number(chart->upper_range)},
                     {"range", json_numbers(chart->range)},
                     {"outside", chart->outside}};
  }
  if (const auto found = performance(values, tolerance)) {
    json["performance"] = {
        {"mean", json_number(found->mean)},        {"s", json_number(found->s)},
        {"Pp", optional_json(found->Pp)},          {"Ppk", optional_json(found->Ppk)},
        {"lower", optional_json(tolerance.lower)}, {"upper", optional_json(tolerance.upper)}};
  }
  return json;
}

Json parameters_json(const std::vector<const HistoryRun*>& series, const HistoryOptions& options) {
  Json parameters = Json::array();
  if (series.empty()) return parameters;
  const auto& described = series.front()->result->parameters;
  for (std::size_t i = 0; i < described.size(); ++i) {
    const auto found = options.tolerances.find(described[i].name);
    Json json =
        series_json(series, i, found == options.tolerances.end() ? Tolerance{} : found->second);
    json["name"] = described[i].name;
    json["unit"] = described[i].unit;
    parameters.push_back(std::move(json));
  }
  return parameters;
}

/// Of every unit the first result and the last one count: what passed at once, and what in the end.
Json yield_json(const std::vector<HistoryRun>& runs, const HistoryOptions& options) {
  const auto passed = [](const StoredResult& result) {
    return result.decision == "pass" || result.decision == "conditional_pass";
  };
  std::map<std::string, std::pair<bool, bool>> units;
  std::map<std::string, int> decisions;
  for (const HistoryRun& entry : runs) {
    if (!entry.result || is_golden(options, entry)) continue;
    ++decisions[entry.result->decision];
    if (entry.result->decision == "none") continue;
    const bool pass = passed(*entry.result);
    const auto [unit, first] = units.try_emplace(entry.run.header.serial, pass, pass);
    if (!first) unit->second.second = pass;
  }
  int first_pass = 0;
  int final_pass = 0;
  for (const auto& [serial, pass] : units) {
    first_pass += pass.first ? 1 : 0;
    final_pass += pass.second ? 1 : 0;
  }
  const auto share = [&](int count) {
    return units.empty() ? Json()
                         : Json(static_cast<double>(count) / static_cast<double>(units.size()));
  };
  return {{"units", units.size()},
          {"first_pass", share(first_pass)},
          {"final", share(final_pass)},
          {"decisions", decisions}};
}

}  // namespace

Json result_summary_json(const StoredResult& result) {
  return {{"decision", result.decision},
          {"verdict", result.verdict},
          {"reason", result.reason},
          {"effects", result.effects},
          {"created_utc", result.created_utc},
          {"limit_mps2", optional_json(result.limit_mps2)},
          {"max_abs_error_mps2", optional_json(result.max_abs_error_mps2)},
          {"u_mps2", optional_json(result.u_mps2)},
          {"before_mps2", json_array(result.before_mps2)},
          {"after_mps2", json_array(result.after_mps2)}};
}

History::History(HistoryOptions options) : options_(std::move(options)) {}

std::vector<StoredResult> History::results() const {
  const std::lock_guard lock(mutex_);
  std::set<fs::path> seen;
  std::error_code error;
  auto it = fs::recursive_directory_iterator(options_.results,
                                             fs::directory_options::skip_permission_denied, error);
  for (; !error && it != fs::recursive_directory_iterator() && seen.size() < kMostResults;
       it.increment(error)) {
    if (it.depth() >= kDepth) it.disable_recursion_pending();
    if (it->path().filename() != "result.json") continue;
    // Through a link one could be shown what lies elsewhere.
    std::error_code ignored;
    if (!fs::is_regular_file(it->symlink_status(ignored))) continue;
    const auto written = fs::last_write_time(it->path(), ignored);
    seen.insert(it->path());
    const auto known = known_.find(it->path());
    if (known != known_.end() && known->second.written == written) continue;
    known_[it->path()] = {written, read_result(it->path())};
  }
  std::erase_if(known_, [&](const auto& entry) { return !seen.contains(entry.first); });
  std::vector<StoredResult> found;
  for (const auto& [path, known] : known_) {
    if (known.result) found.push_back(*known.result);
  }
  return found;
}

Result<std::vector<HistoryRun>> History::runs() const {
  std::vector<HistoryRun> entries;
  std::error_code ignored;
  if (!fs::exists(options_.database, ignored)) return entries;
  const auto store = storage::RunStore::open_read_only(options_.database);
  if (!store) return fail(store.error());
  auto runs = store->runs();
  if (!runs) return fail(runs.error());
  std::map<std::string, StoredResult> newest;
  for (StoredResult& result : results()) {
    const auto [known, fresh] = newest.try_emplace(result.chain_head, result);
    if (!fresh && known->second.created_utc <= result.created_utc) known->second = result;
  }
  for (storage::RunSummary& run : *runs) {
    HistoryRun entry{.run = std::move(run), .result = {}};
    const auto found = newest.find(entry.run.chain_head);
    if (found != newest.end() && !entry.run.chain_head.empty()) entry.result = found->second;
    entries.push_back(std::move(entry));
  }
  return entries;
}

Result<HistoryRun> History::run(storage::RunId id) const {
  auto all = runs();
  if (!all) return fail(all.error());
  for (HistoryRun& entry : *all) {
    if (entry.run.id == id) return std::move(entry);
  }
  return fail(ErrorCode::input, fmt::format("there is no run {}", id));
}

Result<Json> History::runs_json(const std::string& serial, std::size_t most) const {
  const auto all = runs();
  if (!all) return fail(all.error());
  const auto lower = [](std::string text) {
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return text;
  };
  Json list = Json::array();
  std::size_t matching = 0;
  for (auto entry = all->rbegin(); entry != all->rend(); ++entry) {
    const storage::RunSummary& run = entry->run;
    if (lower(run.header.serial).find(lower(serial)) == std::string::npos) continue;
    if (++matching > most) continue;
    Json json = {{"id", run.id},
                 {"serial", run.header.serial},
                 {"state", to_string(run.state)},
                 {"started_utc", run.header.started_utc},
                 {"finished_utc", run.finished_utc},
                 {"poses", run.poses},
                 {"samples", run.samples},
                 {"golden", is_golden(options_, *entry)},
                 {"result", Json()}};
    if (entry->result) json["result"] = result_summary_json(*entry->result);
    list.push_back(std::move(json));
  }
  return Json{{"runs", std::move(list)}, {"total", matching}, {"all", all->size()}};
}

Result<Json> History::trends_json() const {
  const auto all = runs();
  if (!all) return fail(all.error());
  // A unit that was measured again counts once, with its last result, at the place of that.
  std::map<std::string, const HistoryRun*> last;
  std::vector<const HistoryRun*> golden;
  for (const HistoryRun& entry : *all) {
    if (!entry.result) continue;
    if (is_golden(options_, entry)) {
      golden.push_back(&entry);
    } else {
      last[entry.run.header.serial] = &entry;
    }
  }
  std::vector<const HistoryRun*> units;
  for (const auto& [serial, entry] : last) units.push_back(entry);
  std::sort(units.begin(), units.end(),
            [](const HistoryRun* a, const HistoryRun* b) { return a->run.id < b->run.id; });
  return Json{{"units", parameters_json(units, options_)},
              {"golden_serial", options_.golden},
              {"golden", parameters_json(golden, options_)},
              {"yield", yield_json(*all, options_)}};
}

Result<Json> History::compare_json(storage::RunId a, storage::RunId b) const {
  const auto first = run(a);
  if (!first) return fail(first.error());
  const auto second = run(b);
  if (!second) return fail(second.error());
  for (const HistoryRun* entry : {&*first, &*second}) {
    if (!entry->result) {
      return fail(ErrorCode::input, fmt::format("run {} has no result", entry->run.id));
    }
  }
  const auto head = [](const HistoryRun& entry) -> Json {
    return {{"id", entry.run.id},
            {"serial", entry.run.header.serial},
            {"started_utc", entry.run.header.started_utc},
            {"result", result_summary_json(*entry.result)}};
  };
  Json rows = Json::array();
  for (std::size_t i = 0; i < first->result->parameters.size(); ++i) {
    const CertifiedParameter& x = first->result->parameters[i];
    const CertifiedParameter& y = second->result->parameters[i];
    rows.push_back({{"name", x.name},
                    {"unit", x.unit},
                    {"a", json_number(x.value)},
                    {"U_a", json_number(2 * x.u)},
                    {"b", json_number(y.value)},
                    {"U_b", json_number(2 * y.u)},
                    {"difference", json_number(y.value - x.value)},
                    {"E_n", json_number(normalized_error(y.value, y.u, x.value, x.u))}});
  }
  return Json{{"a", head(*first)}, {"b", head(*second)}, {"parameters", std::move(rows)}};
}

}  // namespace plumbline::app
