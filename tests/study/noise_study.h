// Is what identify_noise() says of a record true? Simulated records with known terms.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/noise/noise_model.h"
#include "rig/sim/world.h"

namespace plumbline::study {

/// A kind of record.
struct NoiseCase {
  std::string name;
  sim::NoiseTerms truth;
  std::size_t samples = 0;
  double step = 0;  ///< of the converter, 0: none
  /// Standard deviations that the likelihood allows at best, relative, Q N B K; 0: not stated.
  std::array<double, 4> bound{};
  /// B that the relaxations amount to where they lie side by side.
  double relaxation_B = 0;
};
const std::vector<NoiseCase>& noise_cases();

/// One coefficient over all records of a case.
struct NoiseFigures {
  double truth = 0;
  double mean = 0;
  double sd = 0;
  double power_sd = 0;  ///< of the coefficient's square: what the bound is about near zero
  double mean_u = 0;
  double covered = 0;  ///< share within 1.96 u
  double present = 0;  ///< share called present
};

struct NoiseStudy {
  std::array<NoiseFigures, kTermCount> term;
  double adequate = 0;  ///< share of the records
  double lines = 0;
  double markov = 0;
};

/// Records from `first_seed` on, on all cores; the result does not depend on their number.
NoiseStudy study_noise(const NoiseCase& noise_case, int records, std::uint64_t first_seed);

}  // namespace plumbline::study
