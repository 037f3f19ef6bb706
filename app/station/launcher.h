// Starts runs as processes of their own: the same program, the same code as on the command line. A
// run goes on when the station ends.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/io/json.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// Something that an operator can choose to start.
struct StationPlan {
  std::string name;                   ///< as the form shows it
  bool simulated = false;             ///< `dry-run` instead of `run`
  std::filesystem::path config = {};  ///< rig.toml; empty only when simulated: the built-in one
  double speed = 60;                  ///< of a simulated rig
};

struct LauncherOptions {
  std::filesystem::path database;
  std::filesystem::path results;  ///< every run gets a folder of its own below it
  std::vector<StationPlan> plans;
  std::string laboratory;  ///< lab.toml; empty: none
  std::string language = "en";
};

struct StartOrder {
  std::string serial;
  std::string operator_name;
  std::string plan;
  bool resume = false;
};

/// The order in a request's JSON; refused (input) with a reason for the operator when a field is
/// missing, too long or holds what no serial number holds.
Result<StartOrder> start_order(const Json& json);

/// Thread safe.
class Launcher {
 public:
  explicit Launcher(LauncherOptions options);

  /// Refused (input) when there is no such plan or the last start is still under way.
  Result<void> start(const StartOrder& order);
  /// What became of the last start: null, or {running, serial, exit_code, message}.
  Json last_json();
  const LauncherOptions& options() const { return options_; }

 private:
  Result<std::vector<std::string>> words(const StartOrder& order,
                                         const std::filesystem::path& folder) const;
  void look();

  LauncherOptions options_;
  std::mutex mutex_;
  pid_t child_ = -1;
  std::string serial_;
  std::filesystem::path log_;
  std::optional<int> exit_code_;
};

}  // namespace plumbline::app
