// What the batteries share: a folder, the real simulated rig, the real program with its
// environment, and what is true of the unit it simulates.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "app/sequencer/simulated_rig.h"
#include "estimator/measurement.h"
#include "storage/run_store.h"
#include "tests/temp_folder.h"

namespace plumbline::battery {

/// PLUMBLINE_BATTERY_PATIENCE: all deadlines are so many times longer, for a machine that has
/// little time for a battery. 1 without it.
double patience();

/// [plan] … of a run that is through in seconds: a short soak and deltas × h_rows poses.
struct ShortPlan {
  int deltas = 4;
  int h_rows = 3;
  double h_step_deg = 20;
  int samples_per_pose = 20;
  bool floor_known = false;  ///< declared; otherwise it is learnt from the soak

  std::string text() const;
  std::size_t poses() const;  ///< the soak included
};

/// Runs `lane(0)` … `lane(lanes − 1)` beside each other: most of a battery's time is waiting.
void beside_each_other(int lanes, const std::function<void(int)>& lane);

/// Counts and prints what is wrong. Thread safe.
class Complaints {
 public:
  explicit Complaints(std::string battery) : battery_(std::move(battery)) {}
  void add(const std::string& when, const std::string& what);
  void add(const std::string& when, const std::vector<std::string>& all);
  int count() const { return count_; }
  int exit_code() const { return count_ == 0 ? 0 : 1; }

 private:
  std::string battery_;
  std::atomic<int> count_ = 0;
};

struct RigChoice {
  std::string world = "";  ///< appended to a world of white noise on an ideal head
  std::string plan = "";   ///< appended to the rig.toml: [grid], [plan] … of the battery
  double speed = 100;
  bool rtu = false;  ///< the drive on a serial line (pseudo terminal)
  std::uint64_t seed = 7;
};

/// A rig and its rig.toml in `folder`; throws when it does not start.
class Bench {
 public:
  Bench(const TempFolder& folder, RigChoice choice);
  /// Ends the simulated rig (if it lives) and starts it anew on other wires, with `more_world` in
  /// place of what the choice appends.
  void restart(const std::string& more_world);
  const app::SimulatedRig& rig() const { return *rig_; }
  std::filesystem::path config() const { return config_; }
  /// How far the mean of a pose is from the truth on its worst axis, in V.
  double error_V(const storage::PoseRecord& pose) const;

 private:
  RigChoice choice_;
  std::filesystem::path config_;
  std::unique_ptr<app::SimulatedRig> rig_;
  PerAxis<PerAxis<double>> K_V_per_g_{};
  PerAxis<double> U0_V_{};
  double gamma_ = 1;
  Adc adc_;
};

struct Ended {
  int code = 0;  ///< exit code, or −signal
  std::string err;
};

/// `plumbline run` on the bench, as a process of its own.
class Program {
 public:
  Program(const Bench& bench, const std::filesystem::path& database, const TempFolder& folder,
          bool resume, const std::map<std::string, std::string>& environment = {});
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  pid_t process() const { return process_; }
  bool running();
  Ended wait();

 private:
  pid_t process_ = -1;
  int status_ = 0;
  bool ended_ = false;
  std::filesystem::path err_;
};

/// Looks at the database of one unit's last run: sound, chained, nothing doubled, and every pose in
/// `before` still there as it was. Returns what is wrong, one line each.
struct Audit {
  std::vector<std::string> faults;
  std::map<long long, std::string> poses;  ///< ordinal → its bytes
  storage::RunState state = storage::RunState::running;
  bool any_run = false;
};
Audit audit(const std::filesystem::path& database,
            const std::map<long long, std::string>& before = {});

/// Path of the shim (disk_shim.cpp).
std::string shim_path();

}  // namespace plumbline::battery
