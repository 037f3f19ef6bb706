#include "tests/battery/battery.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>

#include "rig/sim/head_errors.h"
#include "rig/sim/world.h"
#include "storage/database.h"
#include "storage/sample_blob.h"

namespace plumbline::battery {

namespace fs = std::filesystem;

namespace {

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// What was built together lies together, also where a copy of it runs while work goes on.
std::string binary(const std::string& name) {
  return fs::read_symlink("/proc/self/exe").parent_path() / name;
}

constexpr const char* kWorld = R"(
[unit]
random = true
[noise]
N = 1.0e-5
)";

}  // namespace

double patience() {
  const char* text = std::getenv("PLUMBLINE_BATTERY_PATIENCE");
  return text == nullptr ? 1 : std::max(1.0, std::atof(text));
}

std::string ShortPlan::text() const {
  const double delta_step_deg = 360.0 / deltas;
  return fmt::format(
      "\n[plan]\nsoak_s = 5\nsamples_per_pose = {}\nverification_poses = 0\n"
      "[settling]\nwindow = 12\n{}"
      "[grid]\ndelta_deg = {{ start = 0, stop = {}, step = {} }}\n"
      "h_deg = {{ start = 0, stop = {}, step = {} }}\n"
      // On a machine without time for the drive's answers, a pose fails for no fault of the run's.
      "[recovery]\nwait_s = {}\nattempts_per_pose = {}\n"
      // What does not pass ends the run before the battery's own deadline.
      "skipped_poses = 2\n",
      samples_per_pose, floor_known ? "noise_V = 0.0001\n" : "", 360 - delta_step_deg,
      delta_step_deg, (h_rows - 1) * h_step_deg, h_step_deg, 60 * patience(),
      std::min(100L, std::lround(3 * patience())));
}

std::size_t ShortPlan::poses() const { return static_cast<std::size_t>(deltas * h_rows + 1); }

void beside_each_other(int lanes, const std::function<void(int)>& lane) {
  std::vector<std::jthread> threads;
  for (int i = 0; i < lanes; ++i) threads.emplace_back([&lane, i] { lane(i); });
}

void Complaints::add(const std::string& when, const std::string& what) {
  // One call, one line: lanes may complain at the same time.
  fmt::print("{}", fmt::format("{}: {}: {}\n", battery_, when, what));
  std::fflush(stdout);
  ++count_;
}

void Complaints::add(const std::string& when, const std::vector<std::string>& all) {
  for (const std::string& what : all) add(when, what);
}

Bench::Bench(const TempFolder& folder, RigChoice choice)
    : choice_(std::move(choice)), config_(folder / "rig.toml") {
  const auto world = sim::parse_world(kWorld + choice_.world, "world");
  if (!world) throw std::runtime_error(world.error().message);
  const sim::Triad triad = sim::draw_triad(*world, choice_.seed);
  K_V_per_g_ = triad.K_V_per_g;
  U0_V_ = triad.U0_V;
  gamma_ = world->gravity.local_mps2 / kStandardGravity_mps2;
  adc_ = world->adc;
  restart(choice_.world);
}

void Bench::restart(const std::string& more_world) {
  rig_.reset();
  auto rig = app::SimulatedRig::start({.world_toml = kWorld + more_world,
                                       .speed = choice_.speed,
                                       .seed = choice_.seed,
                                       .rtu = choice_.rtu});
  if (!rig) throw std::runtime_error(rig.error().message);
  rig_ = std::make_unique<app::SimulatedRig>(*std::move(rig));
  const auto patient_ms = [](int value_ms) { return std::lround(value_ms * patience()); };
  std::ofstream(config_) << "[dut]\nserial = \"B-1\"\n[gravity]\nlocal_mps2 = 9.81012\n"
                         << "[head]\nmodbus = \"" << rig_->modbus()
                         << "\"\npoll_interval_ms = 2\nwatchdog_ms = "
                         << std::min(60000L, patient_ms(3000))
                         << "\nresponse_timeout_ms = " << std::min(2000L, patient_ms(400))
                         << "\nidentity_address = 0x200\nidentity_count = 4\n"
                         << "[sensor]\nsilence_timeout_ms = " << patient_ms(400) << "\ncan = \""
                         << rig_->can() << "\"\nidentity = \"IDENT.Serial\"\n"
                         << choice_.plan;
}

double Bench::error_V(const storage::PoseRecord& pose) const {
  const auto up = sim::attitude({}, pose.delta_deg, pose.h_deg).up;
  double worst = 0;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    double truth = U0_V_[axis];
    for (std::size_t j = 0; j < kAxisCount; ++j) truth += K_V_per_g_[axis][j] * gamma_ * up[j];
    double mean = 0;
    for (const RawSample& sample : pose.samples) {
      mean += adc_.volts(sample.code[axis]) / static_cast<double>(pose.samples.size());
    }
    worst = std::max(worst, std::abs(mean - truth));
  }
  return worst;
}

Program::Program(const Bench& bench, const fs::path& database, const TempFolder& folder,
                 bool resume, const std::map<std::string, std::string>& environment)
    : err_(folder / "err") {
  std::vector<std::string> words = {binary("plumbline"),
                                    "run",
                                    "--config",
                                    bench.config(),
                                    "--serial",
                                    "B-1",
                                    "--db",
                                    database,
                                    "--out",
                                    folder / "out"};
  if (resume) words.emplace_back("--resume");
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  std::vector<std::string> settings;
  for (char** entry = environ; *entry != nullptr; ++entry) settings.emplace_back(*entry);
  for (const auto& [name, value] : environment) settings.push_back(name + "=" + value);
  std::vector<char*> pointers;
  for (std::string& setting : settings) pointers.push_back(setting.data());
  pointers.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err_.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int failed =
      posix_spawn(&process_, words[0].c_str(), &files, nullptr, arguments.data(), pointers.data());
  posix_spawn_file_actions_destroy(&files);
  if (failed != 0) throw std::runtime_error("plumbline cannot be started");
}

Program::~Program() {
  if (ended_) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
}

bool Program::running() {
  if (!ended_) ended_ = ::waitpid(process_, &status_, WNOHANG) == process_;
  return !ended_;
}

Ended Program::wait() {
  if (!ended_) ::waitpid(process_, &status_, 0);
  ended_ = true;
  return {WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_), text_of(err_)};
}

Audit audit(const fs::path& database, const std::map<long long, std::string>& before) {
  Audit result;
  const auto complain = [&](const std::string& what) { result.faults.push_back(what); };
  if (!fs::exists(database)) {
    if (!before.empty()) complain("the database is gone");
    return result;
  }
  {
    // As the next session would open it: recovers the write-ahead log.
    auto store = storage::RunStore::open(database);
    if (!store) {
      complain(store.error().message);
      return result;
    }
    const auto runs = store->runs();
    if (!runs) {
      complain(runs.error().message);
      return result;
    }
    result.any_run = !runs->empty();
    for (const storage::RunSummary& run : *runs) {
      result.state = run.state;
      const auto chain = store->check_chain(run.id);
      if (!chain) {
        complain(chain.error().message);
        continue;
      }
      for (const std::string& fault : chain->faults) complain("chain: " + fault);
    }
    if (!runs->empty()) {
      const auto poses = store->poses(runs->back().id);
      if (!poses) {
        complain(poses.error().message);
        return result;
      }
      for (const storage::PoseRecord& pose : *poses) {
        const auto bytes = storage::pack_samples(pose.samples);
        std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        if (!result.poses.emplace(pose.ordinal, std::move(text)).second) {
          complain(fmt::format("pose {} is doubled", pose.ordinal));
        }
      }
    }
  }
  const auto sound = storage::Database::open(database, storage::OpenMode::create);
  std::string verdict;
  if (!sound || !(*sound)->each("PRAGMA integrity_check",
                                [&](const storage::Statement& row) { verdict += row.text(0); })) {
    verdict = "cannot be checked";
  }
  if (verdict != "ok") complain("integrity_check: " + verdict);
  for (const auto& [ordinal, bytes] : before) {
    const auto now = result.poses.find(ordinal);
    if (now == result.poses.end()) {
      complain(fmt::format("pose {} is lost", ordinal));
    } else if (now->second != bytes) {
      complain(fmt::format("pose {} has changed", ordinal));
    }
  }
  return result;
}

std::string shim_path() { return binary("libplumbline_disk_shim.so"); }

}  // namespace plumbline::battery
