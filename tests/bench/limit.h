// Names that tie a benchmark to the limit it is compared with: "Group/what" and "Group/limit".
#pragma once

#include <benchmark/benchmark.h>

#include <cstddef>
#include <random>
#include <vector>

namespace plumbline::bench {

inline std::vector<double> white_noise(std::size_t n) {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> unit;
  std::vector<double> record(n);
  for (double& value : record) value = unit(engine);
  return record;
}

}  // namespace plumbline::bench
