// Uncertainty budget of a parameter (GUM, JCGM 100): what its standard uncertainty is made of.
#pragma once

#include <vector>

#include "estimator/calibrate.h"

namespace plumbline::app {

enum class BudgetSource { readings, delta, h, gravity, alternatives };

struct BudgetLine {
  BudgetSource source = BudgetSource::readings;
  double estimate = 0;  ///< of the input quantity; 0 for a deviation
  double u = 0;         ///< its standard uncertainty, in its own unit: parameter, ″, ″, m/s²
  double dof = 0;       ///< degrees of freedom; infinite for what was not observed here
  double sensitivity = 1;   ///< parameter unit over the input's unit
  double contribution = 0;  ///< |c|·u, in the parameter's unit
  double share = 0;         ///< of the variance
};

struct Budget {
  std::size_t axis = 0;
  Eigen::Index column = 0;  ///< 0…2: K_ix, K_iy, K_iz in V/g; 3: U_i0 in V
  double value = 0;
  std::vector<BudgetLine> lines;
  double u = 0;              ///< combined, that of the estimate
  double dof_effective = 0;  ///< Welch–Satterthwaite
};

/// The combined variance is that of the certified estimate. Taken out of it: the local gravity (all
/// K of all axes scale with it) and the head's positioning, carried through the least-squares
/// solution on the poses of the run, δ and h of every pose independent; and what the alternatives
/// of the findings add, where there are any. The rest is the scatter of the readings: identified
/// noise, rounding by the converter, and what estimating the added effects together costs.
Budget budget_of(const Calibration& calibration, const RunDescription& description,
                 std::size_t axis, Eigen::Index column);

}  // namespace plumbline::app
