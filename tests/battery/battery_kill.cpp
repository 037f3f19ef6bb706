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
#include <vector>

#include "tests/battery/battery.h"

namespace plumbline::battery {
namespace {

constexpr ShortPlan kSmall = {.samples_per_pose = 10, .floor_known = true};

/// A session that ends by itself must have done so in order.
void check_end(const Ended& ended, Complaints& complaints, const std::string& when) {
  if (ended.code != 0 && ended.code != 1 && ended.code != -SIGKILL) {
    complaints.add(when, fmt::format("ended with {}: {}", ended.code, ended.err));
  }
}

/// Session after session is killed one durable step later than the one before, counted from where a
/// session begins to make progress; once a pose has been committed the count starts anew.
int systematic(int h_rows, int most, double speed, const std::string& place) {
  const ShortPlan plan = {.deltas = 36,
                          .h_rows = h_rows,
                          .h_step_deg = 10,
                          .samples_per_pose = 10,
                          .floor_known = true};
  const TempFolder folder(place);
  const Bench bench(folder,
                    {.world = "[node]\nrate_hz = 50\n", .plan = plan.text(), .speed = speed});
  const auto database = folder / "run.db";
  Complaints complaints("battery-kill");
  std::map<long long, std::string> kept;
  int kills = 0;
  int sessions = 0;
  long at = 1;  // the durable step at which this session dies
  std::size_t poses = 0;
  bool started = false;
  bool finished = false;
  while (!finished && kills < most) {
    const std::string when = fmt::format("session {}, durable step {}", sessions, at);
    Program program(bench, database, folder, started,
                    {{"LD_PRELOAD", shim_path()},
                     {"PLUMBLINE_DISK_FILES", "run.db"},
                     {"PLUMBLINE_DISK_SYNCS", "1"},
                     {"PLUMBLINE_DISK_KILL", std::to_string(at)}});
    const Ended ended = program.wait();
    ++sessions;
    kills += ended.code == -SIGKILL;
    check_end(ended, complaints, when);
    const Audit now = audit(database, kept);
    complaints.add(when, now.faults);
    kept = now.poses;
    started = now.any_run;
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
  if (finished && kept.size() != plan.poses()) {
    complaints.add("at the end", fmt::format("{} poses instead of {}", kept.size(), plan.poses()));
  }
  fmt::print("battery-kill systematic: {} kills at durable steps, {} poses complete, {} faults\n",
             kills, kept.size(), complaints.count());
  return complaints.exit_code();
}

struct Kills {
  int kills = 0;
  int runs = 0;
};

Kills random_moments(int count, bool while_resuming, std::uint64_t seed, double speed,
                     const std::string& place, Complaints& complaints) {
  const TempFolder folder(place);
  const Bench bench(folder, {.plan = kSmall.text(), .speed = speed});
  std::mt19937_64 random(seed);
  int kills = 0;
  int runs = 0;
  std::map<long long, std::string> kept;
  // How long a run takes on this machine: the moments lie within.
  const auto begin = std::chrono::steady_clock::now();
  const Ended whole = Program(bench, folder / "whole.db", folder, false).wait();
  check_end(whole, complaints, "run without a kill");
  if (whole.code != 0 && whole.code != 1) return {};  // nothing would be killed
  const double run_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  auto database = folder / "run0.db";
  bool resume = false;
  while (kills < count) {
    Program program(bench, database, folder, resume);
    const double longest_ms = (while_resuming && resume ? 0.6 : 1.1) * run_ms;
    const double wait_ms = std::uniform_real_distribution<double>(0, longest_ms)(random);
    const auto until =
        std::chrono::steady_clock::now() + std::chrono::duration<double, std::milli>(wait_ms);
    while (program.running() && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
    const bool counts = program.running() && (!while_resuming || resume);
    if (program.running()) ::kill(program.process(), SIGKILL);
    const Ended ended = program.wait();
    kills += counts && ended.code == -SIGKILL;
    const std::string when = fmt::format("run {}, kill {}", runs, kills);
    check_end(ended, complaints, when);
    const Audit now = audit(database, kept);
    complaints.add(when, now.faults);
    kept = now.poses;
    resume = now.any_run;
    if (now.state != storage::RunState::finished) continue;
    if (kept.size() != kSmall.poses()) {
      complaints.add(when, fmt::format("{} poses instead of {}", kept.size(), kSmall.poses()));
    }
    ++runs;
    kept.clear();
    resume = false;
    std::filesystem::remove(database);
    database = folder / fmt::format("run{}.db", runs);
    if (runs % 10 == 0) fmt::print("battery-kill: {} kills, {} runs completed\n", kills, runs);
    std::fflush(stdout);
  }
  return {kills, runs};
}

int random_moments(int count, int jobs, bool while_resuming, std::uint64_t seed, double speed,
                   const std::string& place) {
  Complaints complaints("battery-kill");
  std::vector<Kills> lanes(static_cast<std::size_t>(jobs));
  beside_each_other(jobs, [&](int lane) {
    const int share = count / jobs + (lane < count % jobs ? 1 : 0);
    lanes[static_cast<std::size_t>(lane)] = random_moments(
        share, while_resuming, seed + static_cast<std::uint64_t>(lane), speed, place, complaints);
  });
  Kills all;
  for (const Kills& lane : lanes) {
    all.kills += lane.kills;
    all.runs += lane.runs;
  }
  fmt::print("battery-kill {}: {} kills, {} runs completed, {} faults\n",
             while_resuming ? "resume" : "random", all.kills, all.runs, complaints.count());
  return complaints.exit_code();
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
  std::string place = "/tmp";
  int jobs = 1;
  CLI::App* systematic = app.add_subcommand("systematic");
  systematic->add_option("--h-rows", h_rows)->check(CLI::Range(1, 9));
  systematic->add_option("--most", most, "stop after so many kills");
  CLI::App* random = app.add_subcommand("random");
  CLI::App* resume = app.add_subcommand("resume");
  for (CLI::App* sub : {random, resume}) {
    sub->add_option("--count", count);
    sub->add_option("--jobs", jobs, "so many rigs beside each other")->check(CLI::Range(1, 64));
  }
  for (CLI::App* sub : {systematic, random, resume}) {
    sub->add_option("--speed", speed);
    sub->add_option("--seed", seed);
    sub->add_option("--in", place, "where the databases are: what is killed here is no disk");
  }
  CLI11_PARSE(app, argc, argv);
  if (systematic->parsed()) return plumbline::battery::systematic(h_rows, most, speed, place);
  return plumbline::battery::random_moments(count, jobs, resume->parsed(), seed, speed, place);
}
