// The N-th write or sync fails with "no space left", N = 1 … all; files that may not grow; a small
// file system. Each time: one clear line, exit code 3 (or 2 before anything has begun), nothing
// lost, and the run can be resumed.
//
//   battery_disk_full shim [--from N] [--step K] [--most M]
//   battery_disk_full limit        RLIMIT_FSIZE, ever larger
//   battery_disk_full folder DIR   a small file system mounted at DIR
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <fstream>

#include "tests/battery/battery.h"

namespace plumbline::battery {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPlan = R"(
[plan]
soak_s = 5
samples_per_pose = 10
verification_poses = 0
[settling]
window = 8
noise_V = 0.0001
[grid]
delta_deg = { start = 0, stop = 270, step = 90 }
h_deg = { start = 0, stop = 20, step = 20 }
[recovery]
wait_s = 60
)";
constexpr std::size_t kPoses = 9;

int faults = 0;
void complain(const std::string& when, const std::string& what) {
  fmt::print("battery-disk-full: {}: {}\n", when, what);
  ++faults;
}

/// The session that met the full disk, then one with room again.
void check(const Bench& bench, const Folder& folder, const fs::path& database, const Ended& full,
           const std::string& when) {
  const auto lines = std::count(full.err.begin(), full.err.end(), '\n');
  const std::size_t last = full.err.rfind("plumbline: ");
  if (full.code != 3 && full.code != 2) complain(when, fmt::format("exit code {}", full.code));
  if (lines < 1 || last == std::string::npos) complain(when, "no clear line: " + full.err);
  const Audit before = audit(database);
  for (const std::string& fault : before.faults) complain(when, fault);
  Program again(bench, database, folder, before.any_run);
  const Ended ended = again.wait();
  if (ended.code != 0 && ended.code != 1) {
    complain(when, fmt::format("not resumable ({}): {}", ended.code, ended.err));
  }
  const Audit now = audit(database, before.poses);
  for (const std::string& fault : now.faults) complain(when, "after resuming: " + fault);
  if (now.poses.size() != kPoses) {
    complain(when, fmt::format("{} poses instead of {}", now.poses.size(), kPoses));
  }
}

int shim(long from, long step, long most, double speed) {
  const Folder folder;
  const Bench bench(folder, {.plan = kPlan, .speed = speed});
  long met = 0;
  for (long n = from; met < most; n += step) {
    const fs::path database = folder / fmt::format("run{}.db", n);
    Ended ended;
    {
      Program program(bench, database, folder, false,
                      {{"LD_PRELOAD", shim_path()},
                       {"PLUMBLINE_DISK_FILES", fmt::format("run{}.db", n)},
                       {"PLUMBLINE_DISK_FULL", std::to_string(n)}});
      ended = program.wait();
    }
    if (ended.code == 0 || ended.code == 1) break;  // fewer steps than that: all have been met
    ++met;
    check(bench, folder, database, ended, fmt::format("step {}", n));
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(database.string() + suffix);
    if (met % 50 == 0) fmt::print("battery-disk-full: {} failing steps\n", met);
    std::fflush(stdout);
  }
  fmt::print("battery-disk-full shim: {} failing steps, {} faults\n", met, faults);
  return faults == 0 ? 0 : 1;
}

int limit(double speed) {
  const Folder folder;
  const Bench bench(folder, {.plan = kPlan, .speed = speed});
  std::signal(SIGXFSZ, SIG_IGN);
  int met = 0;
  for (rlim_t bytes = 4096;; bytes += 8192) {
    const fs::path database = folder / fmt::format("run{}.db", bytes);
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const rlimit limited{bytes, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limited);
    Ended ended;
    {
      Program program(bench, database, folder, false);
      ended = program.wait();
    }
    setrlimit(RLIMIT_FSIZE, &before);
    if (ended.code == 0 || ended.code == 1) break;
    ++met;
    const std::string when = fmt::format("limit of {} bytes", bytes);
    if (audit(database).state == storage::RunState::finished) continue;  // certificate too large
    check(bench, folder, database, ended, when);
  }
  fmt::print("battery-disk-full limit: {} limits, {} faults\n", met, faults);
  return faults == 0 ? 0 : 1;
}

int small_folder(const std::string& place, double speed) {
  const Folder folder;
  const Bench bench(folder, {.plan = kPlan, .speed = speed});
  const fs::path database = fs::path(place) / "run.db";
  const fs::path filler = fs::path(place) / "filler";
  int met = 0;
  // Filled up but for less and less; the program's own look at the room is part of what is tested.
  for (const std::uintmax_t left : {4'000'000U, 1'000'000U, 300'000U, 60'000U, 8192U, 0U}) {
    {
      std::ofstream fill(filler, std::ios::binary);
      const auto room = fs::space(place).available;
      const std::string block(4096, 'x');
      for (std::uintmax_t done = 0; done + left + block.size() <= room; done += block.size()) {
        fill << block;
      }
    }
    Ended ended;
    {
      Program program(bench, database, folder, false);
      ended = program.wait();
    }
    ++met;
    const std::string when = fmt::format("{} bytes left", left);
    if (ended.code != 3 && ended.code != 2) complain(when, fmt::format("exit code {}", ended.code));
    if (ended.err.find("make room") == std::string::npos &&
        ended.err.find("disk") == std::string::npos &&
        ended.err.find("space") == std::string::npos) {
      complain(when, "the message does not say so: " + ended.err);
    }
    fs::remove(filler);
    for (const std::string& fault : audit(database).faults) complain(when, fault);
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(database.string() + suffix);
  }
  fmt::print("battery-disk-full folder: {} fillings, {} faults\n", met, faults);
  return faults == 0 ? 0 : 1;
}

}  // namespace
}  // namespace plumbline::battery

int main(int argc, char** argv) {
  CLI::App app{"a disk that is full at every write"};
  app.require_subcommand(1);
  long from = 1;
  long step = 1;
  long most = 1'000'000;
  double speed = 200;
  std::string place;
  CLI::App* shim = app.add_subcommand("shim");
  shim->add_option("--from", from);
  shim->add_option("--step", step);
  shim->add_option("--most", most);
  CLI::App* limit = app.add_subcommand("limit");
  CLI::App* folder = app.add_subcommand("folder");
  folder->add_option("place", place)->required();
  for (CLI::App* sub : {shim, limit, folder}) sub->add_option("--speed", speed);
  CLI11_PARSE(app, argc, argv);
  if (shim->parsed()) return plumbline::battery::shim(from, step, most, speed);
  if (limit->parsed()) return plumbline::battery::limit(speed);
  return plumbline::battery::small_folder(place, speed);
}
