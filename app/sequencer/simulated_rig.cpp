#include "app/sequencer/simulated_rig.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <thread>
#include <utility>
#include <vector>

#include "rig/strict_toml.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

constexpr const char* kProgram = "plumbline-simrig";
constexpr std::chrono::seconds kStartLimit{20};
constexpr std::chrono::milliseconds kStartPoll{5};
constexpr std::chrono::seconds kEndLimit{5};

std::string program_path() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const fs::path beside = self.parent_path() / kProgram;
  return !error && fs::exists(beside, error) ? beside.string() : kProgram;
}

/// Short, because the path of a Unix socket has at most 107 bytes.
Result<fs::path> make_folder() {
  std::string pattern = "/tmp/plumbline-XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr) {
    return fail(ErrorCode::output,
                fmt::format("/tmp: no temporary folder for the simulated rig can "
                            "be made ({})",
                            std::strerror(errno)));
  }
  return fs::path(pattern);
}

/// True when the child has ended (and is then reaped).
bool reap_within(pid_t process, std::chrono::steady_clock::duration limit) {
  const auto end = std::chrono::steady_clock::now() + limit;
  for (;;) {
    if (waitpid(process, nullptr, WNOHANG) != 0) return true;
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(kStartPoll);
  }
}

}  // namespace

Result<SimulatedRig> SimulatedRig::start(const SimulatedRigOptions& options) {
  SimulatedRig rig;
  auto folder = make_folder();
  if (!folder) return fail(folder.error());
  rig.folder_ = *std::move(folder);
  std::ofstream(rig.folder_ / "world.toml", std::ios::binary) << options.world_toml;
  if (auto launched = rig.launch(options); !launched) return fail(launched.error());
  if (auto ready = rig.await_ready(); !ready) return fail(ready.error());
  return rig;
}

Result<void> SimulatedRig::launch(const SimulatedRigOptions& options) {
  const std::string program = program_path();
  std::vector<std::string> words = {
      program,
      "--world",
      (folder_ / "world.toml").string(),
      "--modbus",
      options.rtu ? "rtu:" + (folder_ / "line").string() : "tcp:127.0.0.1:0",
      "--can",
      "unix:" + (folder_ / "can").string(),
      "--speed",
      fmt::format("{}", options.speed),
      "--seed",
      fmt::format("{}", options.seed),
      "--ready-file",
      (folder_ / "ready.toml").string(),
      "--exit-with-parent"};
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  const std::string log = (folder_ / "log").string();
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, log.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  const int failed =
      posix_spawnp(&process_, program.c_str(), &files, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (failed == 0) return {};
  process_ = -1;
  return fail(ErrorCode::input,
              fmt::format("{} cannot be started ({}); it belongs beside plumbline or on the PATH",
                          kProgram, std::strerror(failed)));
}

Error SimulatedRig::refusal() const {
  std::ifstream log(folder_ / "log", std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(log), {}};
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return {ErrorCode::input, text.empty() ? fmt::format("{} ended without a word", kProgram) : text};
}

Result<void> SimulatedRig::await_ready() {
  const fs::path ready = folder_ / "ready.toml";
  const auto limit = std::chrono::steady_clock::now() + kStartLimit;
  while (!fs::exists(ready)) {
    if (reap_within(process_, {})) {
      process_ = -1;
      return fail(refusal());
    }
    if (std::chrono::steady_clock::now() > limit) {
      return fail(ErrorCode::rig,
                  fmt::format("{} does not get ready within {} s", kProgram, kStartLimit.count()));
    }
    std::this_thread::sleep_for(kStartPoll);
  }
  auto file = rig::StrictFile::read(ready);
  if (!file) return fail(file.error());
  rig::StrictTable root = file->root();
  modbus_ = root.text("modbus");
  can_ = root.text("can");
  return file->finish();
}

SimulatedRig::SimulatedRig(SimulatedRig&& other) noexcept
    : folder_(std::exchange(other.folder_, {})),
      process_(std::exchange(other.process_, -1)),
      modbus_(std::move(other.modbus_)),
      can_(std::move(other.can_)) {}

SimulatedRig::~SimulatedRig() {
  if (process_ > 0) {
    kill(process_, SIGTERM);
    if (!reap_within(process_, kEndLimit)) {
      kill(process_, SIGKILL);
      waitpid(process_, nullptr, 0);
    }
  }
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

}  // namespace plumbline::app
