// What the noise of single readings depends on. Nothing of it shows in the pose means, but it says
// how much each of them is worth, and it has a cause.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/effects/visit_log.h"
#include "estimator/error_figures.h"

namespace plumbline {

/// The variable that the white noise of an axis follows.
struct NoiseDriver {
  std::size_t axis = 0;
  std::string driver;       ///< as in result.json
  std::string shape;        ///< such that UnlistedStructure::is_of_noise()
  double p_value = 1;       ///< of the search as a whole
  double sigmas = 0;        ///< without counting how much was looked at
  double heldout_gain = 0;  ///< share that it removes of the excess scatter on visits left out
  double ratio = 1;         ///< of the largest to the smallest standard deviation that it makes
  double u_ratio = 0;
  /// Variance that the mean of each visit has beyond that of a visit as quiet as the quietest, V².
  Eigen::VectorXd excess_V2 = {};
  /// Whether that it changes with the driver is all that is known of it.
  bool at_random = false;
};

/// The likeliest for each axis, if chance would not show as much in one of 10⁴ sets and the noise
/// changes by more than a sixth. Of the logarithm of the variance of each dwell, freed of what is
/// slow and of lines, which is nearly Gaussian: straight lines and parabolas of every variable and
/// of |a_i|, harmonics of δ, steps and windows of the time, steps of recorded columns; within the
/// dwells, the first quarter against the rest. Nothing for an axis whose converter hides the noise,
/// or with fewer than 16 readings in a dwell.
std::vector<NoiseDriver> noise_drivers(const VisitLog& log, const MeasurementSet& set,
                                       const std::vector<Blocks>& partitions);

}  // namespace plumbline
