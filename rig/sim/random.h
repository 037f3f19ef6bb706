// Random numbers of the simulated world: every source has a stream of its own, named in the code,
// so that switching one thing on leaves the draws of all others as they were.
#pragma once

#include <cstdint>
#include <random>
#include <string_view>

namespace plumbline::sim {

/// One independent stream of a seed.
class Random {
 public:
  Random(std::uint64_t seed, std::string_view stream) : engine_(mixed(seed, stream)) {}

  /// Standard normal.
  double normal() { return normal_(engine_); }
  /// Uniform in [low, high).
  double uniform(double low = 0, double high = 1) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  /// −1 or +1.
  double sign() { return (engine_() & 1U) != 0 ? 1.0 : -1.0; }
  /// Uniform in 0 … count − 1.
  std::size_t index(std::size_t count) {
    return static_cast<std::size_t>(uniform(0, static_cast<double>(count)));
  }

 private:
  /// FNV-1a over the stream's name, then the finisher of splitmix64.
  static std::uint64_t mixed(std::uint64_t seed, std::string_view stream) {
    std::uint64_t hash = 0xcbf29ce484222325U ^ (seed * 0x9e3779b97f4a7c15U);
    for (const char c : stream) {
      hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
    }
    hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9U;
    hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebU;
    return hash ^ (hash >> 31);
  }

  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

}  // namespace plumbline::sim
