// A calibration applied to readings: specific force from output voltages.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/calibrate.h"

namespace plumbline {

struct Corrected {
  std::vector<Eigen::Vector3d> a_mps2;  ///< one per reading, sensor frame
  std::vector<std::string> applied;     ///< effects that were taken off
  /// Effects that a reading alone does not tell: of the head and the base, of what came before, of
  /// one run, of a column that the file lacks.
  std::vector<std::string> left_out;
  std::vector<std::string> lacking;  ///< columns that effects among them need
  std::vector<BeyondRange> beyond;   ///< columns that were elsewhere during the calibration
  PerAxis<std::size_t> at_rail{};    ///< readings at an end of the converter's range, or beyond
  PerAxis<std::size_t> beyond_1g{};  ///< specific forces larger than any of the calibration
};

/// a = K⁻¹·(U − U_0 − K_ii·[terms]) for every reading; the terms depend on a and are found by
/// repetition. t_s on the clock of the calibration run. Precondition: at least one reading.
Corrected correct_readings(const CertifiedModel& model, const SampleTable& readings,
                           const RunDescription& description);

}  // namespace plumbline
