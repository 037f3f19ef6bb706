// Overlapping Allan deviation of 10⁷ samples. Limit: one cumulative sum, then for each averaging
// time one plain pass over it, in the same run on the same machine.
#include <cstring>
#include <numeric>

#include "estimator/noise/allan.h"
#include "estimator/noise/identify.h"
#include "tests/bench/limit.h"

namespace plumbline::bench {
namespace {

constexpr std::size_t kSamples = 10'000'000;

const std::vector<double>& record() {
  static const std::vector<double> values = white_noise(kSamples);
  return values;
}

/// Second differences in vectors of four, the textbook's loop.
[[gnu::target("avx2")]] double plain_pass(const std::vector<double>& x, std::size_t m) {
  using Four = double __attribute__((vector_size(32)));
  Four sum = {};
  const std::size_t count = x.size() - 2 * m;
  for (std::size_t i = 0; i + 4 <= count; i += 4) {
    Four a;
    Four b;
    Four c;
    std::memcpy(&a, &x[i], sizeof a);
    std::memcpy(&b, &x[i + m], sizeof b);
    std::memcpy(&c, &x[i + 2 * m], sizeof c);
    const Four d = c - 2 * b + a;
    sum += d * d;
  }
  return sum[0] + sum[1] + sum[2] + sum[3];
}

void limit(benchmark::State& state, TauSpacing spacing) {
  const std::vector<std::size_t> factors = averaging_factors(Deviation::oadev, kSamples, spacing);
  for (auto _ : state) {
    std::vector<double> sums(kSamples + 1);
    std::partial_sum(record().begin(), record().end(), sums.begin() + 1);
    for (const std::size_t m : factors) benchmark::DoNotOptimize(plain_pass(sums, m));
  }
}

void ours(benchmark::State& state, TauSpacing spacing, bool all_cores) {
  const std::vector<std::size_t> factors = averaging_factors(Deviation::oadev, kSamples, spacing);
  for (auto _ : state) {
    const std::vector<double> phase = integrate_record(record(), 100);
    benchmark::DoNotOptimize(
        deviations_at(Deviation::oadev, phase, 100, factors, all_cores).front().value);
  }
}

BENCHMARK_CAPTURE(limit, octave, TauSpacing::octave)
    ->Name("Allan 1e7 octave/limit")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(ours, octave, TauSpacing::octave, false)
    ->Name("Allan 1e7 octave/one core")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(ours, octave_all, TauSpacing::octave, true)
    ->Name("Allan 1e7 octave/all cores")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(limit, log, TauSpacing::log100)
    ->Name("Allan 1e7 log100/limit")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(ours, log, TauSpacing::log100, false)
    ->Name("Allan 1e7 log100/one core")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(ours, log_all, TauSpacing::log100, true)
    ->Name("Allan 1e7 log100/all cores")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void identify(benchmark::State& state) {
  const std::vector<double> part(record().begin(), record().begin() + state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(identify_noise(part, 100).N.value);
}
BENCHMARK(identify)
    ->Name("Identify noise")
    ->Arg(360'000)
    ->Arg(1'000'000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace plumbline::bench
