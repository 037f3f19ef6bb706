// What the added effects do to the twelve parameters.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "estimator/calibrate.h"

namespace plumbline {

/// A parameter that is another beside the added effects than by the twelve alone.
struct ShiftedParameter {
  std::size_t axis = 0;
  Eigen::Index column = 0;  ///< 0…2: K_ix, K_iy, K_iz in V/g; 3: U_i0 in V
  double before = 0;        ///< estimates.batch_ls
  double after = 0;         ///< final.batch_ls
  double u = 0;             ///< of `after`

  double expanded_u() const { return 2 * u; }
  double in_expanded_u() const { return (after - before) / expanded_u(); }
};

/// Those that moved by more than their expanded uncertainty, k = 2, in the order x, y, z; none
/// where nothing joined the model.
std::vector<ShiftedParameter> shifted_parameters(const Calibration& calibration);

}  // namespace plumbline
