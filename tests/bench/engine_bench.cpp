// The eight-state filter against one Eigen update without prediction, least squares against Eigen's
// factorisation, and the whole `calibrate` as a program of its own with its peak memory.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "estimator/fit/eight_state_filter.h"
#include "estimator/fit/least_squares.h"
#include "rig/sim/record.h"
#include "rig/sim/world.h"
#include "tests/bench/limit.h"

namespace plumbline::bench {
namespace {

namespace fs = std::filesystem;

constexpr int kUpdates = 10'000;

void filter_limit(benchmark::State& state) {
  using Vector8 = Eigen::Matrix<double, 8, 1>;
  using Matrix8 = Eigen::Matrix<double, 8, 8>;
  for (auto _ : state) {
    Matrix8 P = Matrix8::Identity();
    Vector8 x = Vector8::Zero();
    Vector8 h = Vector8::Ones();
    for (int i = 0; i < kUpdates; ++i) {
      h(0) = i % 7;
      const Vector8 Ph = P * h;
      const Vector8 gain = Ph / (h.dot(Ph) + 1);
      x += gain * (0.1 - h.dot(x));
      P.noalias() -= gain * Ph.transpose();
    }
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(filter_limit)
    ->Name("Filter 10000 samples/limit")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void filter(benchmark::State& state) {
  NoiseModel noise;
  noise.B = {1e-4, 0, true, 0};
  noise.K = {1e-5, 0, true, 0};
  noise.R = {1e-7, 0, true, 0};
  for (auto _ : state) {
    EightStateFilter filter(noise, {}, 0);
    for (int i = 1; i <= kUpdates; ++i) {
      filter.predict(0.01 * i + 0.001 * (i % 3));
      filter.update({0.1 * (i % 7), 0.2, 0.5}, 0.1, 1e-8);
    }
    benchmark::DoNotOptimize(filter.state().data());
  }
}
BENCHMARK(filter)
    ->Name("Filter 10000 samples/predict and update")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

Eigen::MatrixXd design() {
  Eigen::MatrixXd a = Eigen::MatrixXd::Random(324, 4);
  a.col(3).setOnes();
  return a;
}

void squares_limit(benchmark::State& state) {
  const Eigen::MatrixXd a = design();
  const Eigen::VectorXd y = a * Eigen::Vector4d(1, 2, 3, 4);
  for (auto _ : state) {
    const Eigen::VectorXd x = a.householderQr().solve(y);
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(squares_limit)
    ->Name("Least squares 324 x 4/limit")
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();

void squares(benchmark::State& state) {
  const Eigen::MatrixXd a = design();
  const Eigen::VectorXd y = a * Eigen::Vector4d(1, 2, 3, 4);
  for (auto _ : state) benchmark::DoNotOptimize(solve_least_squares(a, y).x.data());
}
BENCHMARK(squares)
    ->Name("Least squares 324 x 4/solve_least_squares")
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime();

/// 324 poses × 1000 samples and one hour at rest at 100 Hz.
void calibrate(benchmark::State& state) {
  std::string pattern = (fs::temp_directory_path() / "plumbline-bench-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return state.SkipWithError("no temporary folder");
  const fs::path folder = pattern;
  const auto world = sim::read_world(PLUMBLINE_SOURCE_DIR "/rig/sim/worlds/default.toml");
  if (!world) return state.SkipWithError(world.error().message.c_str());
  sim::RecordOptions options;
  options.samples_per_pose = 1000;
  options.soak_s = 3600;
  if (const auto written = sim::write_set(sim::record_set(*world, options), folder); !written)
    return state.SkipWithError(written.error().message.c_str());
  const std::string program = PLUMBLINE_BINARY_DIR "/plumbline";
  const std::string samples = folder / "samples.csv";
  const std::string static_record = folder / "static.csv";
  const std::string config = folder / "run.toml";
  const std::string out = folder / "out";
  for (auto _ : state) {
    const pid_t child = ::fork();
    if (child == 0) {
      if (std::freopen("/dev/null", "w", stdout) == nullptr) ::_exit(126);
      ::execl(program.c_str(), program.c_str(), "calibrate", "--samples", samples.c_str(),
              "--static", static_record.c_str(), "--config", config.c_str(), "--out", out.c_str(),
              nullptr);
      ::_exit(127);
    }
    int status = 0;
    struct rusage used = {};
    ::wait4(child, &status, 0, &used);
    if (!WIFEXITED(status) || WEXITSTATUS(status) > 1) state.SkipWithError("calibrate failed");
    state.counters["peak_MB"] = static_cast<double>(used.ru_maxrss) / 1024;
    state.counters["cpu_s"] =
        static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
        1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
  }
  fs::remove_all(folder);
}
BENCHMARK(calibrate)
    ->Name("Calibrate 324 x 1000 + 1 h at rest")
    ->Unit(benchmark::kMillisecond)
    ->Iterations(3)
    ->UseRealTime();

}  // namespace
}  // namespace plumbline::bench
