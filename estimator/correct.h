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
};

/// a = K⁻¹·(U − U_0 − K_ii·[terms]) for every reading; the terms depend on a and are found by
/// repetition. t_s on the clock of the calibration run. Precondition: at least one reading.
Corrected correct_readings(const CertifiedModel& model, const SampleTable& readings,
                           const RunDescription& description);

}  // namespace plumbline
