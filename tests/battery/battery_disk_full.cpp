// The N-th write or sync fails with "no space left", N = 1 … all; files that may not grow; a small
// file system. Each time: one clear line, exit code 3 (or 2 before anything has begun), nothing
// lost, and the run can be resumed.
//
//   battery_disk_full shim [--from N] [--step K] [--most M] [--jobs J]
//   battery_disk_full limit        RLIMIT_FSIZE, ever larger
//   battery_disk_full folder DIR   a small file system mounted at DIR
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "tests/battery/battery.h"

namespace plumbline::battery {
namespace {

namespace fs = std::filesystem;

constexpr ShortPlan kPlan = {.h_rows = 2, .samples_per_pose = 10, .floor_known = true};

/// The session that met the full disk, then one with room again.
void check(const Bench& bench, const TempFolder& folder, const fs::path& database,
           const Ended& full, const std::string& when, Complaints& complaints) {
  const auto lines = std::count(full.err.begin(), full.err.end(), '\n');
  const std::size_t last = full.err.rfind("plumbline: ");
  if (full.code != 3 && full.code != 2)
    complaints.add(when, fmt::format("exit code {}", full.code));
  if (lines < 1 || last == std::string::npos) complaints.add(when, "no clear line: " + full.err);
  const Audit before = audit(database);
  complaints.add(when, before.faults);
  fs::remove_all(folder / "out");
  Program again(bench, database, folder, before.any_run);
  const Ended ended = again.wait();
  if (ended.code != 0 && ended.code != 1) {
    complaints.add(when, fmt::format("not resumable ({}): {}", ended.code, ended.err));
  }
  const Audit now = audit(database, before.poses);
  complaints.add(when + ", resumed", now.faults);
  if (now.poses.size() != kPlan.poses()) {
    complaints.add(when, fmt::format("{} poses instead of {}", now.poses.size(), kPlan.poses()));
  }
}

/// Lets `meet(bench, folder, n)` meet the full disk at n = from, from + step … in `jobs` lanes,
/// until it says that it was not met any more, or `most` times. Returns how often it was.
template <class Meet>
long meet_all(long from, long step, long most, int jobs, double speed, const std::string& place,
              Meet&& meet) {
  std::atomic<long> next = 0;
  std::atomic<long> met = 0;
  std::atomic<bool> all_met = false;
  beside_each_other(jobs, [&](int) {
    const TempFolder folder(place);
    const Bench bench(folder, {.plan = kPlan.text(), .speed = speed});
    while (!all_met) {
      const long index = next++;
      if (index >= most) return;
      if (!meet(bench, folder, from + index * step)) {
        all_met = true;
        return;
      }
      if (++met % 50 == 0) fmt::print("battery-disk-full: {} met\n", met.load());
      std::fflush(stdout);
    }
  });
  return met;
}

int shim(long from, long step, long most, int jobs, double speed, const std::string& place) {
  Complaints complaints("battery-disk-full");
  const auto meet = [&](const Bench& bench, const TempFolder& folder, long n) {
    const fs::path database = folder / fmt::format("run{}.db", n);
    Ended ended;
    {
      Program program(bench, database, folder, false,
                      {{"LD_PRELOAD", shim_path()},
                       {"PLUMBLINE_DISK_FILES", fmt::format("run{}.db", n)},
                       {"PLUMBLINE_DISK_FULL", std::to_string(n)}});
      ended = program.wait();
    }
    if (ended.code == 0 || ended.code == 1) return false;  // fewer steps: all have been met
    if (ended.err.find("free some space") == std::string::npos) {
      complaints.add(fmt::format("step {}", n),
                     "the message does not say what to do: " + ended.err);
    }
    check(bench, folder, database, ended, fmt::format("step {}", n), complaints);
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(database.string() + suffix);
    return true;
  };
  const long met = meet_all(from, step, most, jobs, speed, place, meet);
  fmt::print("battery-disk-full shim: {} failing steps, {} faults\n", met, complaints.count());
  return complaints.exit_code();
}

int limit(double speed, const std::string& place) {
  Complaints complaints("battery-disk-full");
  const TempFolder folder(place);
  const Bench bench(folder, {.plan = kPlan.text(), .speed = speed});
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
    check(bench, folder, database, ended, when, complaints);
  }
  fmt::print("battery-disk-full limit: {} limits, {} faults\n", met, complaints.count());
  return complaints.exit_code();
}

int small_folder(const std::string& place, double speed) {
  Complaints complaints("battery-disk-full");
  const TempFolder folder;
  const Bench bench(folder, {.plan = kPlan.text(), .speed = speed});
  const fs::path database = fs::path(place) / "run.db";
  const fs::path filler = fs::path(place) / "filler";
  const auto fill_but = [&](std::uintmax_t left) {
    std::ofstream fill(filler, std::ios::binary);
    const auto room = fs::space(place).available;
    const std::string block(4096, 'x');
    for (std::uintmax_t done = 0; done + left + block.size() <= room; done += block.size()) {
      fill << block;
    }
  };
  int met = 0;
  // Somebody else fills the disk during the run.
  for (const std::size_t poses : {0U, 1U, 3U, 5U, 7U}) {
    Ended ended;
    {
      Program program(bench, database, folder, false);
      while (program.running() && audit(database).poses.size() < poses) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
      fill_but(0);
      ended = program.wait();
    }
    fs::remove(filler);
    if (ended.code != 0 && ended.code != 1) {  // it was quicker
      ++met;
      check(bench, folder, database, ended, fmt::format("full after {} poses", poses), complaints);
    }
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(database.string() + suffix);
  }
  // Filled up but for less and less; the program's own look at the room is part of what is tested.
  for (const std::uintmax_t left : {4'000'000U, 1'000'000U, 300'000U, 60'000U, 8192U, 0U}) {
    fill_but(left);
    Ended ended;
    {
      Program program(bench, database, folder, false);
      ended = program.wait();
    }
    ++met;
    const std::string when = fmt::format("{} bytes left", left);
    if (ended.code != 3 && ended.code != 2)
      complaints.add(when, fmt::format("exit code {}", ended.code));
    if (ended.err.find("make room") == std::string::npos &&
        ended.err.find("disk") == std::string::npos &&
        ended.err.find("space") == std::string::npos) {
      complaints.add(when, "the message does not say so: " + ended.err);
    }
    fs::remove(filler);
    complaints.add(when, audit(database).faults);
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(database.string() + suffix);
  }
  fmt::print("battery-disk-full folder: {} fillings, {} faults\n", met, complaints.count());
  return complaints.exit_code();
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
  std::string place = "/tmp";
  CLI::App* shim = app.add_subcommand("shim");
  shim->add_option("--from", from);
  shim->add_option("--step", step);
  shim->add_option("--most", most);
  int jobs = 1;
  shim->add_option("--jobs", jobs, "so many rigs beside each other")->check(CLI::Range(1, 64));
  CLI::App* limit = app.add_subcommand("limit");
  CLI::App* folder = app.add_subcommand("folder");
  folder->add_option("place", place)->required();
  for (CLI::App* sub : {shim, limit, folder}) sub->add_option("--speed", speed);
  for (CLI::App* sub : {shim, limit}) sub->add_option("--in", place, "where the databases are");
  CLI11_PARSE(app, argc, argv);
  if (shim->parsed()) return plumbline::battery::shim(from, step, most, jobs, speed, place);
  if (limit->parsed()) return plumbline::battery::limit(speed, place);
  return plumbline::battery::small_folder(place, speed);
}
