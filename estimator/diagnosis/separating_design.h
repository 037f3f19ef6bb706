// Poses that tell models apart, from what a head can visit after a run.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "estimator/diagnosis/alternatives.h"

namespace plumbline {

inline constexpr double kDecided = 25;  ///< 5 standard deviations, squared

/// Stops after a run, and how far the rivals are from what was found once they were visited.
struct Proposal {
  std::vector<SeparatingPlan::Stop> stops;
  double samples_factor = 1;
  const char* how = "";
  std::vector<double> distance;  ///< squared, one per rival
  std::vector<double> most;      ///< the same, the largest that any pattern reached
  std::size_t decided() const {
    return static_cast<std::size_t>(
        std::count_if(distance.begin(), distance.end(), [](double d) { return d >= kDecided; }));
  }
};

/// The shortest of some patterns of stops within reach that decides most of the rivals of the
/// result's model; T-optimality (Atkinson & Fedorov, Biometrika 62, 1975), greedily. No stops where
/// none decides any.
Proposal best_proposal(const SearchInput& input, const SearchResult& result,
                       const std::vector<Alternative>& rivals, const HeadReach& reach);

}  // namespace plumbline
