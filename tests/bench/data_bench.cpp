// Reading CSV against parsing the same numbers out of memory; storing poses against writing the
// same bytes with as many fsyncs.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "app/io/csv.h"
#include "storage/run_store.h"
#include "tests/bench/limit.h"

namespace plumbline::bench {
namespace {

namespace fs = std::filesystem;

/// A folder for the whole program.
const fs::path& folder() {
  static const struct Folder {
    fs::path path;
    Folder() {
      std::string pattern = (fs::temp_directory_path() / "plumbline-bench-XXXXXX").string();
      if (::mkdtemp(pattern.data()) == nullptr) std::abort();
      path = pattern;
    }
    ~Folder() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
  } folder;
  return folder.path;
}

constexpr int kRows = 360'000;

const std::string& csv_text() {
  static const std::string text = [] {
    const std::vector<double> noise = white_noise(3 * kRows);
    std::string lines = "t_s,ux_V,uy_V,uz_V\n";
    for (std::size_t i = 0; i < kRows; ++i)
      lines += fmt::format("{:.4f},{:.7f},{:.7f},{:.7f}\n", 0.01 * static_cast<double>(i),
                           -2.5 + 1e-4 * noise[3 * i], -2.4 + 1e-4 * noise[3 * i + 1],
                           -2.3 + 1e-4 * noise[3 * i + 2]);
    return lines;
  }();
  return text;
}

void csv_limit(benchmark::State& state) {
  for (auto _ : state) {
    const std::string& text = csv_text();
    const char* at = text.data() + text.find('\n') + 1;
    const char* const end = text.data() + text.size();
    std::vector<double> values;
    values.reserve(4 * kRows);
    while (at < end) {
      double value = 0;
      at = std::from_chars(at, end, value).ptr + 1;
      values.push_back(value);
    }
    benchmark::DoNotOptimize(values.data());
  }
}
BENCHMARK(csv_limit)
    ->Name("CSV 360000 rows x 4/limit")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void csv_read(benchmark::State& state) {
  const fs::path file = folder() / "static.csv";
  std::ofstream(file, std::ios::binary) << csv_text();
  for (auto _ : state) {
    const auto record = app::read_static(file);
    if (!record) state.SkipWithError(record.error().message.c_str());
    benchmark::DoNotOptimize(record->samples.t_s.data());
  }
}
BENCHMARK(csv_read)
    ->Name("CSV 360000 rows x 4/read_static")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

constexpr int kPoses = 100;
constexpr int kReadings = 100;

storage::PoseRecord pose_of(long long ordinal) {
  storage::PoseRecord pose;
  pose.ordinal = ordinal;
  for (int i = 0; i < kReadings; ++i) {
    RawSample sample;
    sample.counter = ordinal * kReadings + i;
    sample.t_s = 10.0 * static_cast<double>(ordinal) + 0.01 * i;
    sample.code = {i, -i, 7};
    sample.temp_C = 20;
    pose.samples.push_back(sample);
  }
  return pose;
}

void store_limit(benchmark::State& state) {
  const fs::path file = folder() / "plain.bin";
  const std::string bytes(kReadings * 32, 'x');
  for (auto _ : state) {
    const int handle = ::open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
    for (int pose = 0; pose < kPoses; ++pose) {
      if (::write(handle, bytes.data(), bytes.size()) < 0) state.SkipWithError("write");
      ::fdatasync(handle);
    }
    ::close(handle);
  }
}
BENCHMARK(store_limit)
    ->Name("SQLite 100 poses x 100 samples, write/limit")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

storage::RunId fill(storage::RunStore& store) {
  storage::RunHeader header;
  header.serial = "B-1";
  header.program_version = "bench";
  header.config_toml = "[dut]\n";
  header.plan_csv = "ordinal\n";
  header.started_utc = "2026-01-02T03:04:05Z";
  header.rate_hz = 100;
  header.adc = {.bits = 16, .min_V = -5, .max_V = 0};
  const auto run = store.create_run(header);
  if (!run) return 0;
  for (long long ordinal = 0; ordinal < kPoses; ++ordinal)
    if (!store.commit_pose(*run, pose_of(ordinal))) return 0;
  return *run;
}

void store_write(benchmark::State& state) {
  const fs::path file = folder() / "write.db";
  for (auto _ : state) {
    state.PauseTiming();
    for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(file.string() + suffix);
    auto store = storage::RunStore::open(file);
    state.ResumeTiming();
    if (!store || fill(*store) == 0) state.SkipWithError("store");
  }
}
BENCHMARK(store_write)
    ->Name("SQLite 100 poses x 100 samples, write/commit_pose")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void store_read(benchmark::State& state) {
  const fs::path file = folder() / "read.db";
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(file.string() + suffix);
  auto store = storage::RunStore::open(file);
  const storage::RunId run = store ? fill(*store) : 0;
  if (run == 0) state.SkipWithError("store");
  for (auto _ : state) {
    const auto loaded = store->load(run);
    if (!loaded) state.SkipWithError("load");
    benchmark::DoNotOptimize(loaded->grid.samples.t_s.data());
  }
}
BENCHMARK(store_read)
    ->Name("SQLite 100 poses x 100 samples, read/load")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace plumbline::bench
