// kill −9 at every durable step of a run and at random moments, also while resuming.
//
//   battery_kill systematic [--h-rows N]   one run of 36 × N + soak poses (9: 324), killed at every
//                                          durable step that takes it further, and resumed
//   battery_kill random --count N          N kills at random moments of runs of a small plan
//   battery_kill resume --count N          N kills at random moments shortly after resuming
#include <fmt/format.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <random>
#include <thread>

#include "tests/battery/battery.h"

namespace plumbline::battery {
namespace {

constexpr const char* kQuick = R"(
[plan]
soak_s = 5
samples_per_pose = 10
verification_poses = 0
[settling]
window = 8
noise_V = 0.0001
)";

std::string plan_of(int h_rows) {
  return std::string(kQuick) +
         fmt::format("[grid]\nh_deg = {{ start = 0, stop = {}, step = 10 }}\n", 10 * (h_rows - 1));
}

std::string small_plan() {
  return std::string(kQuick) +
         "[grid]\ndelta_deg = { start = 0, stop = 270, step = 90 }\n"
         "h_deg = { start = 0, stop = 40, step = 20 }\n";
}

/// Counts and prints what is wrong.
class Tally {
 public:
  void take(const std::vector<std::string>& faults, const std::string& when) {
    for (const std::string& fault : faults) {
      fmt::print("battery-kill: {}: {}\n", when, fault);
      ++faults_;
    }
  }
  int faults() const { return faults_; }

 private:
  int faults_ = 0;
};

/// A session that ends by itself must have done so in order.
void check_end(const Ended& ended, Tally& tally, const std::string& when) {
  if (ended.code != 0 && ended.code != 1 && ended.code != -SIGKILL) {
    tally.take({fmt::format("ended with {}: {}", ended.code, ended.err)}, when);
  }
}

/// Session after session is killed one durable step later than the one before, counted from where a
/// session begins to make progress; once a pose has been committed the count starts anew.
int systematic(int h_rows, int most, double speed) {
  const Folder folder;
  Bench bench(folder, {.world = "[node]\nrate_hz = 50\n",
                       .plan = plan_of(h_rows) + "[recovery]\nwait_s = 60\n",
                       .speed = speed});
  const auto database = folder / "run.db";
  Tally tally;
  std::map<long long, std::string> kept;
  int kills = 0;
  int sessions = 0;
  long at = 1;  // the durable step at which this session dies
  std::size_t poses = 0;
  bool finished = false;
  while (!finished && kills < most) {
    const std::string when = fmt::format("session {}, durable step {}", sessions, at);
    bool started = false;
    {
      const Audit before = audit(database, kept);
      started = before.any_run;
    }
    Program program(bench, database, folder, started,
                    {{"LD_PRELOAD", shim_path()},
                     {"PLUMBLINE_DISK_FILES", "run.db"},
                     {"PLUMBLINE_DISK_SYNCS", "1"},
                     {"PLUMBLINE_DISK_KILL", std::to_string(at)}});
    const Ended ended = program.wait();
    ++sessions;
    kills += ended.code == -SIGKILL;
    check_end(ended, tally, when);
    const Audit now = audit(database, kept);
    tally.take(now.faults, when);
    kept = now.poses;
    finished = now.state == storage::RunState::finished && ended.code != -SIGKILL;
    if (ended.code != -SIGKILL && ended.code != 0 && ended.code != 1) break;
    if (kept.size() > poses) {
      poses = kept.size();
      at = std::max(1L, at - 5);  // the steps of the next pose come where those of this one did
      if (poses % 20 == 0) fmt::print("battery-kill: {} poses, {} kills\n", poses, kills);
      std::fflush(stdout);
    } else {
      ++at;
    }
  }
  const auto expected = static_cast<std::size_t>(36 * h_rows + 1);
  if (finished && kept.size() != expected) {
    tally.take({fmt::format("{} poses instead of {}", kept.size(), expected)}, "at the end");
  }
  fmt::print("battery-kill systematic: {} kills at durable steps, {} poses complete, {} faults\n",
             kills, kept.size(), tally.faults());
  return tally.faults() == 0 ? 0 : 1;
}

int random_moments(int count, bool while_resuming, std::uint64_t seed, double speed) {
  const Folder folder;
  Bench bench(folder, {.plan = small_plan() + "[recovery]\nwait_s = 60\n", .speed = speed});
  std::mt19937_64 random(seed);
  Tally tally;
  int kills = 0;
  int runs = 0;
  std::map<long long, std::string> kept;
  // How long a run takes on this machine: the moments lie within.
  const auto begin = std::chrono::steady_clock::now();
  check_end(Program(bench, folder / "whole.db", folder, false).wait(), tally, "run without a kill");
  if (tally.faults() > 0) return 1;  // nothing would be killed
  const double run_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  auto database = folder / "run0.db";
  while (kills < count) {
    const bool resume = audit(database).any_run;
    Program program(bench, database, folder, resume);
    const double longest_ms = (while_resuming && resume ? 0.6 : 1.1) * run_ms;
    const double wait_ms = std::uniform_real_distribution<double>(0, longest_ms)(random);
    const auto until =
        std::chrono::steady_clock::now() + std::chrono::duration<double, std::milli>(wait_ms);
    while (program.running() && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    const bool counts = program.running() && (!while_resuming || resume);
    if (program.running()) ::kill(program.process(), SIGKILL);
    const Ended ended = program.wait();
    kills += counts && ended.code == -SIGKILL;
    const std::string when = fmt::format("run {}, kill {}", runs, kills);
    check_end(ended, tally, when);
    const Audit now = audit(database, kept);
    tally.take(now.faults, when);
    kept = now.poses;
    if (now.state != storage::RunState::finished) continue;
    if (kept.size() != 13) tally.take({fmt::format("{} poses instead of 13", kept.size())}, when);
    ++runs;
    kept.clear();
    std::filesystem::remove(database);
    database = folder / fmt::format("run{}.db", runs);
    if (runs % 50 == 0) fmt::print("battery-kill: {} kills, {} runs completed\n", kills, runs);
    std::fflush(stdout);
  }
  fmt::print("battery-kill {}: {} kills, {} runs completed, {} faults\n",
             while_resuming ? "resume" : "random", kills, runs, tally.faults());
  return tally.faults() == 0 ? 0 : 1;
}

}  // namespace
}  // namespace plumbline::battery

int main(int argc, char** argv) {
  CLI::App app{"kill -9 at every durable step, at random moments, and while resuming"};
  app.require_subcommand(1);
  int h_rows = 9;
  int count = 1000;
  int most = 1'000'000;
  double speed = 200;
  std::uint64_t seed = 1;
  CLI::App* systematic = app.add_subcommand("systematic");
  systematic->add_option("--h-rows", h_rows)->check(CLI::Range(1, 9));
  systematic->add_option("--most", most, "stop after so many kills");
  CLI::App* random = app.add_subcommand("random");
  CLI::App* resume = app.add_subcommand("resume");
  for (CLI::App* sub : {random, resume}) sub->add_option("--count", count);
  for (CLI::App* sub : {systematic, random, resume}) {
    sub->add_option("--speed", speed);
    sub->add_option("--seed", seed);
  }
  CLI11_PARSE(app, argc, argv);
  if (systematic->parsed()) return plumbline::battery::systematic(h_rows, most, speed);
  return plumbline::battery::random_moments(count, resume->parsed(), seed, speed);
}
