// Many runs in one process and in fresh ones: does anything grow, and are the results the same?
//   battery_soak runs [--in-process N] [--fresh M]
//   battery_soak throughput [--seconds S]
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>

#include "app/config/rig_description.h"
#include "app/sequencer/session.h"
#include "tests/battery/battery.h"

namespace plumbline::battery {
namespace {

namespace fs = std::filesystem;

constexpr ShortPlan kPlan;

long resident_kB() {
  std::ifstream file("/proc/self/statm");
  long total = 0;
  long resident = 0;
  file >> total >> resident;
  return resident * (::sysconf(_SC_PAGESIZE) / 1024);
}

/// The smallest value in the n-th quarter (from 0): how much a run holds in between depends on how
/// often the machine has no time for it, what is never given back stays.
long least(const std::vector<long>& values, std::size_t quarter) {
  const auto begin = values.begin() + static_cast<std::ptrdiff_t>(quarter * values.size() / 4);
  const auto end = values.begin() + static_cast<std::ptrdiff_t>((quarter + 1) * values.size() / 4);
  return begin == end ? 0 : *std::min_element(begin, end);
}

long descriptors() {
  return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
}

/// Root mean square distance of the pose means from the truth: the same for every run but for
/// noise.
double error_of(const Bench& bench, const fs::path& database) {
  const auto store = storage::RunStore::open_read_only(database);
  if (!store) return std::nan("");
  const auto poses = store->poses(1);
  if (!poses || poses->size() != kPlan.poses()) return std::nan("");
  double square = 0;
  for (const storage::PoseRecord& pose : *poses) {
    const double error_V = bench.error_V(pose);
    square += error_V * error_V / static_cast<double>(poses->size());
  }
  return std::sqrt(square);
}

struct Distribution {
  double mean = 0;
  double sd = 0;
};

Distribution distribution(const std::vector<double>& values) {
  Distribution result;
  const auto n = static_cast<double>(values.size());
  for (const double value : values) result.mean += value / n;
  for (const double value : values) {
    result.sd += (value - result.mean) * (value - result.mean) / std::max(1.0, n - 1);
  }
  result.sd = std::sqrt(result.sd);
  return result;
}

int runs(int in_process, int fresh, double speed) {
  Complaints complaints("battery-soak");
  std::vector<double> errors_here;
  std::vector<double> errors_fresh;
  std::vector<long> memory_kB;
  std::vector<long> open_files;
  for (int i = 0; i < in_process; ++i) {
    const TempFolder folder;
    const Bench bench(
        folder, {.plan = kPlan.text(), .speed = speed, .seed = static_cast<std::uint64_t>(i)});
    const auto rig = app::read_rig_description(bench.config());
    app::EngineControl control;
    const auto session =
        app::run_session({.rig = *rig, .database = folder / "run.db"}, control, {});
    if (!session || !session->outcome) {
      complaints.add(fmt::format("run {}", i),
                     session ? session->outcome.error().message : session.error().message);
      continue;
    }
    errors_here.push_back(error_of(bench, folder / "run.db"));
    memory_kB.push_back(resident_kB());
    open_files.push_back(descriptors());
    if ((i + 1) % 20 == 0) {
      fmt::print("battery-soak: {} runs, {} kB, {} descriptors\n", i + 1, memory_kB.back(),
                 open_files.back());
      std::fflush(stdout);
    }
  }
  for (int i = 0; i < fresh; ++i) {
    const TempFolder folder;
    const Bench bench(
        folder,
        {.plan = kPlan.text(), .speed = speed, .seed = static_cast<std::uint64_t>(10000 + i)});
    const auto ended = Program(bench, folder / "run.db", folder, false).wait();
    if (ended.code != 0 && ended.code != 1) {
      complaints.add(fmt::format("fresh run {}", i), ended.err);
      continue;
    }
    errors_fresh.push_back(error_of(bench, folder / "run.db"));
  }
  if (open_files.size() > 10 && open_files.back() > open_files[5]) {
    complaints.add("descriptors",
                   fmt::format("grow from {} to {}", open_files[5], open_files.back()));
  }
  const long first_kB = least(memory_kB, 1);
  const long growth_kB = least(memory_kB, 3) - first_kB;
  if (memory_kB.size() > 10 && growth_kB > 2048) {
    complaints.add("memory", fmt::format("grows by {} kB", growth_kB));
  }
  const Distribution here = distribution(errors_here);
  const Distribution there = distribution(errors_fresh);
  if (errors_here.size() > 5 && errors_fresh.size() > 5) {
    const double u = std::hypot(here.sd / std::sqrt(static_cast<double>(errors_here.size())),
                                there.sd / std::sqrt(static_cast<double>(errors_fresh.size())));
    if (!(std::abs(here.mean - there.mean) < 4 * u)) {
      complaints.add("results", fmt::format("differ: {:.4g} V and {:.4g} V, u = {:.2g} V",
                                            here.mean, there.mean, u));
    }
  }
  fmt::print(
      "battery-soak runs: {} in one process (memory {} kB in their second quarter, {:+} kB in "
      "the last; {} descriptors), {} fresh; error {:.4g} ± {:.2g} mV and {:.4g} ± {:.2g} mV; "
      "{} faults\n",
      errors_here.size(), first_kB, growth_kB, open_files.empty() ? 0 : open_files.back(),
      errors_fresh.size(), 1e3 * here.mean, 1e3 * here.sd, 1e3 * there.mean, 1e3 * there.sd,
      complaints.count());
  return complaints.exit_code();
}

/// 4,000 samples a second in two frames each, in real time, one long record into the database.
int throughput(double seconds) {
  const TempFolder folder(".");  // on the disk, not on a tmpfs
  Bench bench(folder, {.world = "[node]\nrate_hz = 4000\n",
                       .plan = fmt::format(
                           "rate_hz = 4000\n[plan]\nsoak_s = {}\nsamples_per_pose = 4000\n"
                           "verification_poses = 0\n[grid]\ndelta_deg = {{ start = 0, stop = "
                           "270, step = 90 }}\nh_deg = {{ start = 0, stop = 40, step = 20 }}\n",
                           seconds),
                       .speed = 1});
  const auto begin = std::chrono::steady_clock::now();
  const auto rig = app::read_rig_description(bench.config());
  if (!rig) {
    fmt::print("battery-soak: {}\n", rig.error().message);
    return 1;
  }
  rusage before{};
  getrusage(RUSAGE_SELF, &before);
  app::EngineControl control;
  const auto session = app::run_session({.rig = *rig, .database = folder / "run.db"}, control, {});
  rusage after{};
  getrusage(RUSAGE_SELF, &after);
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const auto cpu_s = [](const rusage& use) {
    return static_cast<double>(use.ru_utime.tv_sec + use.ru_stime.tv_sec) +
           1e-6 * static_cast<double>(use.ru_utime.tv_usec + use.ru_stime.tv_usec);
  };
  const double share = (cpu_s(after) - cpu_s(before)) / wall_s;
  std::string bus;
  bool finished = false;
  if (const auto store = storage::RunStore::open_read_only(folder / "run.db")) {
    if (const auto stored = store->load(1)) {
      finished = stored->summary.state == storage::RunState::finished;
      for (const storage::EventRecord& event : stored->events) {
        if (event.kind == "bus") bus = event.text;
      }
    }
  }
  const bool lost_none = bus.find(" 0 lost;") != std::string::npos &&
                         bus.find(" 0 dropped by the kernel, 0 by the queue") != std::string::npos;
  fmt::print("battery-soak throughput: {:.0f} s at 8,000 frames/s, {:.1f} % of one core, {}{}\n",
             wall_s, 100 * share, bus, lost_none && finished ? "" : " – LOST OR NOT FINISHED");
  return session && session->outcome && lost_none && finished && share < 0.15 ? 0 : 1;
}

}  // namespace
}  // namespace plumbline::battery

int main(int argc, char** argv) {
  CLI::App app{"many runs, and many frames"};
  app.require_subcommand(1);
  int in_process = 200;
  int fresh = 50;
  double speed = 100;
  double seconds = 600;
  CLI::App* runs = app.add_subcommand("runs");
  runs->add_option("--in-process", in_process);
  runs->add_option("--fresh", fresh);
  runs->add_option("--speed", speed);
  CLI::App* throughput = app.add_subcommand("throughput");
  throughput->add_option("--seconds", seconds);
  CLI11_PARSE(app, argc, argv);
  return runs->parsed() ? plumbline::battery::runs(in_process, fresh, speed)
                        : plumbline::battery::throughput(seconds);
}
