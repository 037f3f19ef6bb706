// Faults of the drive's wire, of the drive and of the sensor bus at many moments: every run ends in
// good order, and no pose holds a wrong value – the truth is known to the simulated unit.
//
//   battery_wire modbus [--count N] [--seed S] [--rtu]
//   battery_wire drive  [--count N] [--seed S]
//   battery_wire can    [--count N] [--seed S]
#include <fmt/format.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <random>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/battery/battery.h"

namespace plumbline::battery {
namespace {

constexpr ShortPlan kPlan;
/// Noise of 0.1 mV a sample and 20 samples: 0.02 mV; a wrong angle of 0.1° gives 0.06 mV.
constexpr double kWrong_V = 2.5e-4;

std::string fault(const std::string& kind, const std::string& rest) {
  return fmt::format("\n[[faults]]\nkind = \"{}\"\n{}\n", kind, rest);
}

struct Case {
  std::string kind;  ///< what is counted together
  std::string name;
  std::string world;
  bool may_fail = false;   ///< ending the run safely is right, too
  bool must_fail = false;  ///< going on would be wrong
  std::map<std::string, std::string> environment;
  bool resuming = false;  ///< the run is stopped half way and resumed in that world
};

struct Counts {
  int runs = 0;
  int finished = 0;
  int ended_safely = 0;
  int noticed = 0;                   ///< runs with a retry or a fault among their events
  std::map<std::string, int> when;   ///< states of the engine in which the first of them came
  std::map<std::string, int> kinds;  ///< runs with each kind of fault
  int poses = 0;
  int wrong = 0;

  void add(const Counts& more) {
    runs += more.runs;
    finished += more.finished;
    ended_safely += more.ended_safely;
    noticed += more.noticed;
    for (const auto& [state, times] : more.when) when[state] += times;
    for (const auto& [kind, times] : more.kinds) kinds[kind] += times;
    poses += more.poses;
    wrong += more.wrong;
  }
};

std::string listed(const std::map<std::string, int>& counts) {
  std::string text;
  for (const auto& [name, times] : counts) {
    text += fmt::format("{}{} {}", text.empty() ? "" : "; ", name, times);
  }
  return text;
}

/// The state in which the first fault was noticed; empty when none was.
std::string state_at_fault(const std::vector<storage::EventRecord>& events) {
  const auto resumed = std::find_if(events.rbegin(), events.rend(),
                                    [](const auto& event) { return event.kind == "resume"; });
  std::string state;
  for (auto event = resumed == events.rend() ? events.begin() : resumed.base();
       event != events.end(); ++event) {
    if (event->kind == "state") state = event->text.substr(0, event->text.find(':'));
    if (event->kind == "retry" || event->kind == "fault") return state;
  }
  return "";
}

void run_case(const Case& one, double speed, bool rtu, std::uint64_t seed, const std::string& place,
              Counts& counts, Complaints& complaints) {
  const TempFolder folder(place);
  Bench bench(folder, {.world = one.resuming ? "" : one.world,
                       .plan = kPlan.text(),
                       .speed = speed,
                       .rtu = rtu,
                       .seed = seed});
  const auto database = folder / "run.db";
  const auto complain = [&](const std::string& what) {
    complaints.add(fmt::format("{} (seed {})", one.name, seed), what);
  };
  if (one.resuming) {
    Program program(bench, database, folder, false);
    while (program.running() && audit(database).poses.size() < kPlan.poses() / 2) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ::kill(program.process(), SIGTERM);
    program.wait();
    if (audit(database).state == storage::RunState::finished) return;  // it was quicker
    bench.restart(one.world);
  }
  const bool resume = audit(database).any_run;
  const auto begin = std::chrono::steady_clock::now();
  Ended ended;
  {
    Program program(bench, database, folder, resume, one.environment);
    ended = program.wait();
  }
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  ++counts.runs;
  ++counts.kinds[one.kind];
  if (took_s > 120 * patience()) complain(fmt::format("took {:.0f} s", took_s));
  if ((ended.code == 0 || ended.code == 1) && !one.must_fail) {
    ++counts.finished;
  } else if (ended.code == 3 && (one.may_fail || one.must_fail)) {
    ++counts.ended_safely;
  } else {
    complain(fmt::format("ended with {}: {}", ended.code, ended.err));
  }
  const Audit now = audit(database);
  for (const std::string& what : now.faults) complain(what);
  if (ended.code == 0 && now.poses.size() != kPlan.poses()) {
    complain(fmt::format("{} poses instead of {}", now.poses.size(), kPlan.poses()));
  }
  auto store = storage::RunStore::open_read_only(database);
  if (!store) return complain(store.error().message);
  const auto events = store->load(1);
  if (!events) return complain(events.error().message);
  if (const std::string state = state_at_fault(events->events); !state.empty()) {
    ++counts.noticed;
    ++counts.when[one.resuming ? "resumed, " + state : state];
  }
  const auto poses = store->poses(1);
  if (!poses) return complain(poses.error().message);
  for (const storage::PoseRecord& pose : *poses) {
    ++counts.poses;
    const double error_V = bench.error_V(pose);
    if (error_V < kWrong_V) continue;
    ++counts.wrong;
    complain(fmt::format("pose {} is {:.3f} mV off the truth", pose.ordinal, 1e3 * error_V));
  }
}

Case modbus_case(int index, std::mt19937_64& random) {
  struct Kind {
    const char* name;
    const char* rest;
  };
  static constexpr std::array kKinds = {Kind{"modbus.exception", "code = 1"},
                                        Kind{"modbus.exception", "code = 2"},
                                        Kind{"modbus.exception", "code = 3"},
                                        Kind{"modbus.exception", "code = 4"},
                                        Kind{"modbus.exception", "code = 5"},
                                        Kind{"modbus.exception", "code = 6"},
                                        Kind{"modbus.silence", "count = 3"},
                                        Kind{"modbus.late", ""},
                                        Kind{"modbus.truncated", "bytes = 5"},
                                        Kind{"modbus.bad_crc", ""},
                                        Kind{"modbus.wrong_unit", ""},
                                        Kind{"modbus.wrong_transaction", ""},
                                        Kind{"modbus.reset", ""},
                                        Kind{"modbus.half_open", ""}};
  const Kind& kind = kKinds[static_cast<std::size_t>(index) % kKinds.size()];
  const auto integer = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  const auto real = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const std::string rest = std::string_view(kind.name) == "modbus.late"
                               ? fmt::format("late_s = {}", 0.5 * patience())
                               : kind.rest;
  // 14 kinds leave a remainder of 4: in 70 cases each kind meets each phase once.
  const std::size_t phase = static_cast<std::size_t>(index) % 5;
  static_assert(kKinds.size() % 5 != 0);
  const std::string when = std::array{
      fmt::format("after = {}", integer(0, 12)),                                   // idle
      fmt::format("after = {}", integer(12, 24)),                                  // homing
      fmt::format("move = {}\ndelay_s = {:.2f}", integer(0, 12), real(0.1, 2)),    // moving
      fmt::format("move = {}\ndelay_s = {:.2f}", integer(0, 12), real(3.4, 4.5)),  // sampling
      fmt::format("after = {}", integer(0, 300))}[phase];                          // resuming
  Case one;
  one.kind = kind.name;
  one.name =
      fmt::format("{} {} {} {}", kind.name, rest,
                  std::array{"idle", "homing", "moving", "sampling", "resuming"}[phase], when);
  one.world = fault(kind.name, fmt::format("{}\n{}", rest, when));
  one.resuming = phase == 4;
  // As often silent as the start of a new run is tried.
  one.may_fail = phase == 0 && std::string_view(kind.name) == "modbus.silence";
  return one;
}

/// Another drive, or one that was set up anew between two sessions.
Case swapped_words(bool resuming) {
  Case one;
  one.kind = "word order";
  one.name = resuming ? "word order swapped before resuming" : "word order swapped";
  one.world = "\n[drive]\nword_order = \"low_first\"\n";
  one.must_fail = true;  // positions make no sense
  one.resuming = resuming;
  return one;
}

Case drive_case(int index, std::mt19937_64& random) {
  const int move = std::uniform_int_distribution<int>(0, 12)(random);
  const double delay_s = std::uniform_real_distribution<double>(0, 3)(random);
  const char* axis = std::uniform_int_distribution<int>(0, 1)(random) == 0 ? "delta" : "h";
  static constexpr std::array kKinds = {"drive.stall",       "drive.alarm", "drive.limit",
                                        "drive.lost_homing", "drive.alarm", "drive.slip"};
  const std::size_t which = static_cast<std::size_t>(index) % kKinds.size();
  const std::string kind = kKinds[which];
  const std::string code = which == 4 ? "code = 0x84\n" : "";  // the watchdog's
  Case one;
  one.kind = which == 4 ? "drive.alarm of the watchdog" : kind;
  one.name = fmt::format("{} {} move {} delay {:.2f}", one.kind, axis, move, delay_s);
  one.world = fault(kind, fmt::format("{}axis = \"{}\"\nmove = {}\ndelay_s = {:.3f}{}", code, axis,
                                      move, delay_s, kind == "drive.slip" ? "\nslip_deg = 8" : ""));
  if (kind == "drive.slip") {
    // No encoder sees a slip; what finds it is the homing that the lost one asks for.
    one.world += fault("drive.lost_homing",
                       fmt::format("axis = \"{}\"\nmove = {}", axis, std::min(move + 3, 12)));
  }
  return one;
}

Case can_case(int index, std::mt19937_64& random) {
  const int move = std::uniform_int_distribution<int>(0, 12)(random);
  const double delay_s = std::uniform_real_distribution<double>(0, 3)(random);
  const double share =
      std::exp(std::uniform_real_distribution<double>(std::log(0.001), std::log(0.2))(random));
  const char* axis =
      std::array{"x", "y", "z"}[std::uniform_int_distribution<std::size_t>(0, 2)(random)];
  const std::string trigger = fmt::format("move = {}\ndelay_s = {:.3f}\n", move, delay_s);
  Case one;
  switch (index % 8) {
    case 0:
      one.kind = "can.loss";
      one.name = fmt::format("loss of {:.2f} %", 100 * share);
      one.world = fault("can.loss", fmt::format("probability = {:.5f}", share));
      one.may_fail = share > 0.03;  // 20 consecutive samples are then rare
      break;
    case 1:
      one.kind = "can.reorder";
      one.name = fmt::format("reordering of {:.2f} %", 100 * share);
      one.world = fault("can.reorder", fmt::format("probability = {:.5f}", share));
      one.may_fail = share > 0.03;
      break;
    case 2:
      one.kind = "can.duplicate";
      one.name = fmt::format("duplicates of {:.2f} %", 100 * share);
      one.world = fault("can.duplicate", fmt::format("probability = {:.5f}", share));
      break;
    case 3:
      one.kind = "bus-off";
      one.name = fmt::format("bus-off at move {}", move);
      one.world = fault("can.error_frame", "error_class = 0x40\n" + trigger) +
                  fault("can.silence", trigger + fmt::format("duration_s = {}", 40 * patience()));
      break;
    case 4:
      one.kind = "can.stuck_code";
      one.name = fmt::format("{} stuck at move {}", axis, move);
      one.world =
          fault("can.stuck_code", trigger + fmt::format("axis = \"{}\"\nduration_s = 6", axis));
      break;
    case 5:
      one.kind = "can.saturation";
      one.name = fmt::format("{} saturated at move {}", axis, move);
      one.world =
          fault("can.saturation", trigger + fmt::format("axis = \"{}\"\nduration_s = 3", axis));
      break;
    case 6: {
      const int after = std::uniform_int_distribution<int>(0, 60)(random);
      const char* by_s = index / 8 % 2 == 0 ? "3600" : "-3600";
      one.kind = "time of day";
      one.name = fmt::format("time of day set by {} s after {} looks at it", by_s, after);
      one.environment = {{"LD_PRELOAD", shim_path()},
                         {"PLUMBLINE_CLOCK_STEP", by_s},
                         {"PLUMBLINE_CLOCK_AFTER", std::to_string(after)}};
      one.resuming = index / 16 % 2 == 1;
      break;
    }
    default:
      one.kind = "can.silence";
      one.name = fmt::format("silence at move {}", move);
      one.world = fault("can.silence", trigger + fmt::format("duration_s = {}", 60 * patience()));
  }
  return one;
}

}  // namespace
}  // namespace plumbline::battery

int main(int argc, char** argv) {
  using namespace plumbline::battery;
  CLI::App app{"faults of the wires and of the drive at many moments"};
  app.require_subcommand(1);
  int count = 50;
  double speed = 60;
  bool rtu = false;
  std::uint64_t seed = 1;
  std::string place = "/tmp";
  int jobs = 1;
  std::string only;
  CLI::App* modbus = app.add_subcommand("modbus");
  CLI::App* drive = app.add_subcommand("drive");
  CLI::App* can = app.add_subcommand("can");
  modbus->add_flag("--rtu", rtu, "on a serial line");
  for (CLI::App* sub : {modbus, drive, can}) {
    sub->add_option("--count", count);
    sub->add_option("--speed", speed);
    sub->add_option("--seed", seed);
    sub->add_option("--in", place, "where the databases are");
    sub->add_option("--only", only, "of these the runs with one kind of fault");
    sub->add_option("--jobs", jobs, "so many runs beside each other")->check(CLI::Range(1, 64));
  }
  CLI11_PARSE(app, argc, argv);
  std::mt19937_64 random(seed);
  Counts counts;
  Complaints complaints("battery-wire");
  std::vector<Case> cases;
  for (int i = 0; i < count; ++i) {
    cases.push_back(modbus->parsed()  ? (i % 15 == 14 ? swapped_words(i / 15 % 2 == 1)
                                                      : modbus_case(i - i / 15, random))
                    : drive->parsed() ? drive_case(i, random)
                                      : can_case(i, random));
  }
  if (!only.empty()) {
    std::erase_if(cases, [&](const Case& one) { return one.kind != only; });
  }
  std::mutex mutex;
  std::size_t next = 0;
  beside_each_other(jobs, [&](int) {
    for (std::unique_lock lock(mutex); next < cases.size();) {
      const std::size_t i = next++;
      lock.unlock();
      Counts of_this;
      run_case(cases[i], speed, rtu, seed + i, place, of_this, complaints);
      lock.lock();
      counts.add(of_this);
      if ((i + 1) % 10 == 0) fmt::print("battery-wire: {} runs\n", i + 1);
      std::fflush(stdout);
    }
  });
  fmt::print("battery-wire: runs with {}\n", listed(counts.kinds));
  fmt::print(
      "battery-wire {}: {} runs, {} finished, {} ended safely, {} had to recover ({}); {} poses "
      "accepted, {} of them wrong, {} faults\n",
      app.get_subcommands().front()->get_name(), counts.runs, counts.finished, counts.ended_safely,
      counts.noticed, listed(counts.when), counts.poses, counts.wrong, complaints.count());
  return complaints.exit_code();
}
