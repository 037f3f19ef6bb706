// Uncertainty of the twelve certified parameters twice: by the law of propagation (GUM) and by
// propagating the distributions themselves (GUM Supplement 1, JCGM 101:2008), with the comparison
// of its clause 8.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// The certified estimate as the propagation sees it, linear in the means of n poses:
/// [parameters of x, y, z] = Σ_i gain[i]·(means of axis i). Effects of the head that are estimated
/// together with the twelve tie the axes.
struct PropagatedEstimate {
  PerAxis<Eigen::Vector4d> value;  ///< [K_x K_y K_z U_0], V/g and V
  PerAxis<Eigen::MatrixXd> gain;   ///< 12 × n
  /// 12 × 12, as the estimation states it: by noise, by rounding, and by positioning as if each
  /// axis had a head of its own; gravity not included.
  Eigen::MatrixXd covariance;
  /// 12 × 12, beside that: by what may be true instead of the effects that were found.
  Eigen::MatrixXd alternatives = Eigen::MatrixXd::Zero(4 * kAxisCount, 4 * kAxisCount);
  PerAxis<Eigen::VectorXd> rounding_V2;  ///< n, variance of the offset rounding leaves in a mean
};

/// Share of each source in one parameter, standard uncertainties in its unit (V/g or V).
struct ParameterBudget {
  double noise = 0;
  double delta = 0, h = 0;  ///< the head's positioning
  double rounding = 0;
  double gravity = 0;
  double alternatives = 0;  ///< what may be true instead of the effects that were found
  double combined = 0;
};

/// One parameter: both intervals and whether they agree.
struct ParameterUncertainty {
  ParameterBudget budget;
  double gum_low = 0, gum_high = 0;  ///< y ± 1.96·u
  double mc_mean = 0, mc_u = 0;
  double mc_low = 0, mc_high = 0;  ///< probabilistically symmetric, 95 %
  double difference_low = 0, difference_high = 0;
  double tolerance = 0;    ///< δ of clause 7.9.2 for one significant digit of u
  bool validated = false;  ///< clause 8.1.3: both differences within the tolerance
};

struct UncertaintyReport {
  PerAxis<std::array<ParameterUncertainty, 4>> parameter;
  std::size_t trials = 0;
  bool stabilised = false;  ///< clause 7.9.4 was met before the limit of trials
  bool validated = false;   ///< all twelve
};

/// Distributions: noise normal with what the covariance holds beside positioning and rounding, and
/// so is what the alternatives add; positioning normal in both angles of each pose, seen by all
/// axes alike, through the true kinematics to second order; rounding rectangular; gravity normal.
/// Trials come in blocks of 10⁴ until mean, u and both ends of every interval are stable to the
/// tolerance. Deterministic in input and seed whatever the number of cores.
UncertaintyReport propagate_uncertainty(const PropagatedEstimate& estimate,
                                        const std::vector<Pose>& poses,
                                        const RunDescription& description, std::uint64_t seed);

}  // namespace plumbline
