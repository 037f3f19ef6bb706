// The one place of the core that starts threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace plumbline {

/// Calls work(i) for i = 0 … count − 1 on all cores and returns when all are done. Results must go
/// to places of their own, so that they do not depend on the number of threads. `work` must not
/// throw.
template <class Work>
void parallel_for(std::size_t count, const Work& work) {
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::jthread> helpers;
  for (std::size_t i = 1; i < std::min(count, cores); ++i) helpers.emplace_back(run);
  run();
}

}  // namespace plumbline
