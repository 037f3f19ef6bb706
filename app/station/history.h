// What has been measured and certified: the runs of a database beside the results that lie in a
// folder. Nothing is written.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/io/json.h"
#include "app/station/statistics.h"
#include "estimator/measurement.h"
#include "storage/run_store.h"

namespace plumbline::app {

/// One certified parameter.
struct CertifiedParameter {
  std::string name;  ///< "K_xy", "U0_z"
  std::string unit;  ///< "V/g", "V"
  double value = 0;
  double u = 0;
};

/// What result.json says, as far as it is shown.
struct StoredResult {
  std::filesystem::path folder;
  std::string created_utc;
  std::string chain_head;  ///< of the run it was made from
  std::string decision;    ///< "pass" … "none"
  std::string verdict;     ///< of the diagnosis
  std::string reason;
  std::vector<std::string> effects;  ///< identifiers
  std::optional<double> limit_mps2;
  std::optional<double> max_abs_error_mps2;
  std::optional<double> u_mps2;
  PerAxis<double> before_mps2{};  ///< RMS of held-out poses
  PerAxis<double> after_mps2{};
  std::vector<CertifiedParameter> parameters;  ///< 12
};

struct HistoryRun {
  storage::RunSummary run;
  std::optional<StoredResult> result;  ///< the newest one made from this run
};

struct HistoryOptions {
  std::filesystem::path database;
  std::filesystem::path results;  ///< searched for result.json, three folders deep
  std::string golden = {};        ///< serial of the golden unit; empty: none
  std::map<std::string, Tolerance> tolerances = {};  ///< by parameter, for Pp and Ppk
};

/// Thread safe.
class History {
 public:
  explicit History(HistoryOptions options);

  /// Oldest first; empty while there is no database.
  Result<std::vector<HistoryRun>> runs() const;
  Result<HistoryRun> run(storage::RunId id) const;

  /// The list as JSON, newest first; serials that contain `serial`, at most `most` of them.
  Result<Json> runs_json(const std::string& serial, std::size_t most) const;
  /// Control charts, performance and yield over the last result of every unit; golden unit apart.
  Result<Json> trends_json() const;
  Result<Json> compare_json(storage::RunId a, storage::RunId b) const;
  const HistoryOptions& options() const { return options_; }

 private:
  struct Known {
    std::filesystem::file_time_type written;
    std::optional<StoredResult> result;  ///< nothing: not a calibration of a stored run
  };
  std::vector<StoredResult> results() const;

  HistoryOptions options_;
  mutable std::mutex mutex_;
  mutable std::map<std::filesystem::path, Known> known_;  ///< by path of result.json
};

Json result_summary_json(const StoredResult& result);

}  // namespace plumbline::app
