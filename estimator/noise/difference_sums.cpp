#include "estimator/noise/difference_sums.h"

#include <algorithm>
#include <cstring>

#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

constexpr std::size_t kLanes = 8;
// Eight values that the compiler maps to whatever vectors there are.
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));

// 64 kB of record: with its two shifted views it fits into a second-level cache.
constexpr std::size_t kDifferencesPerBlock = 8192;

/// Always inlined into functions for one kind of processor each. Two accumulators hide the latency
/// of the additions.
[[gnu::always_inline]] inline double block_sum(const double* a, const double* b, const double* c,
                                               std::size_t count) {
  Lanes first = {};
  Lanes second = {};
  std::size_t i = 0;
  for (; i + 2 * kLanes <= count; i += 2 * kLanes) {
    Lanes x;
    Lanes y;
    Lanes z;
    std::memcpy(&x, a + i, sizeof x);
    std::memcpy(&y, b + i, sizeof y);
    std::memcpy(&z, c + i, sizeof z);
    const Lanes d = (z - y) - (y - x);
    first += d * d;
    std::memcpy(&x, a + i + kLanes, sizeof x);
    std::memcpy(&y, b + i + kLanes, sizeof y);
    std::memcpy(&z, c + i + kLanes, sizeof z);
    const Lanes e = (z - y) - (y - x);
    second += e * e;
  }
  double sum = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) sum += first[lane] + second[lane];
  for (; i < count; ++i) {
    const double d = (c[i] - b[i]) - (b[i] - a[i]);
    sum += d * d;
  }
  return sum;
}

using BlockSum = double (*)(const double*, const double*, const double*, std::size_t);

double block_sum_plain(const double* a, const double* b, const double* c, std::size_t count) {
  return block_sum(a, b, c, count);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] double block_sum_avx2(const double* a, const double* b, const double* c,
                                              std::size_t count) {
  return block_sum(a, b, c, count);
}
BlockSum choose_block_sum() {
  return __builtin_cpu_supports("avx2") != 0 ? block_sum_avx2 : block_sum_plain;
}
#else
BlockSum choose_block_sum() { return block_sum_plain; }
#endif

}  // namespace

std::vector<double> second_difference_sums(const std::vector<double>& x,
                                           const std::vector<std::size_t>& lags, bool all_cores) {
  const BlockSum sum_of = choose_block_sum();
  const std::size_t blocks = x.size() / kDifferencesPerBlock + 1;
  std::vector<double> partial(blocks * lags.size(), 0.0);
  const auto work = [&](std::size_t block) {
    const std::size_t begin = block * kDifferencesPerBlock;
    for (std::size_t j = 0; j < lags.size(); ++j) {
      const std::size_t m = lags[j];
      if (x.size() <= 2 * m || begin >= x.size() - 2 * m) continue;
      const std::size_t count = std::min(kDifferencesPerBlock, x.size() - 2 * m - begin);
      const double* a = x.data() + begin;
      partial[block * lags.size() + j] = sum_of(a, a + m, a + 2 * m, count);
    }
  };
  if (all_cores) {
    // Stretches of many blocks, so that taking the next one costs nothing.
    constexpr std::size_t kStretch = 32;
    parallel_for((blocks + kStretch - 1) / kStretch, [&](std::size_t stretch) {
      const std::size_t end = std::min(blocks, (stretch + 1) * kStretch);
      for (std::size_t block = stretch * kStretch; block < end; ++block) work(block);
    });
  } else {
    for (std::size_t block = 0; block < blocks; ++block) work(block);
  }
  std::vector<double> sums(lags.size(), 0.0);
  for (std::size_t block = 0; block < blocks; ++block)
    for (std::size_t j = 0; j < lags.size(); ++j) sums[j] += partial[block * lags.size() + j];
  return sums;
}

}  // namespace plumbline
