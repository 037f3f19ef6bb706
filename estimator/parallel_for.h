// The one place of the core that starts threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <optional>
#include <thread>
#include <vector>

#include "estimator/linear_algebra.h"

namespace plumbline {

/// As long as one lives, parallel_for() of its thread starts no others: for programs that work on
/// several runs at once.
class SerialScope {
 public:
  SerialScope() { ++depth(); }
  ~SerialScope() { --depth(); }
  SerialScope(const SerialScope&) = delete;
  SerialScope& operator=(const SerialScope&) = delete;
  static bool active() { return depth() > 0; }

 private:
  static int& depth() {
    static thread_local int value = 0;
    return value;
  }
};

/// Counted once: each count reads a file of the system.
inline std::size_t usable_cores() {
  static const std::size_t cores =
      linear_algebra_is_thread_safe() ? std::max(1U, std::thread::hardware_concurrency()) : 1;
  return cores;
}

/// Calls work(i) for i = 0 … count − 1 on all cores and returns when all are done. Results must go
/// to places of their own, so that they do not depend on the number of threads. `work` must not
/// throw.
template <class Work>
void parallel_for(std::size_t count, const Work& work) {
  const std::size_t cores = SerialScope::active() ? 1 : usable_cores();
  // Three like tasks end sooner when two cores share them than when one core has the third alone.
  const std::size_t threads = count < 2 * cores ? count : cores;
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    std::optional<SerialScope> busy;  // as all cores are
    if (count >= 2 * cores) busy.emplace();
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> helpers;
  for (std::size_t i = 1; i < threads; ++i) helpers.emplace_back(run);
  run();
}

}  // namespace plumbline
