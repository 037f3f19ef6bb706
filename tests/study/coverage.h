// Do the stated uncertainties hold? Simulated units with known truth, calibrated one after another.
//
// Nothing is undeclared, so the truth of a unit is exactly the 12 parameters it was drawn with: no
// effect moves U0, the head is ideal, gravity is what the description says. Where the noise is
// coloured, U0 is the level from which the run started: how far the random walk came before counts
// as part of it, what it did during the run and the flicker count as noise.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/measurement.h"

namespace plumbline::study {

/// Parameters of a triad, K_ix K_iy K_iz U_i0 of x, then of y, then of z.
inline constexpr Eigen::Index kParameters = 12;
using ParameterVector = Eigen::Matrix<double, kParameters, 1>;
std::string parameter_name(Eigen::Index parameter);

/// What converts the outputs, and how much noise there is before it.
struct Converter {
  int bits = 16;
  double noise_steps = 4;  ///< standard deviation of a sample, in steps of the converter
  /// Flicker (its Allan plateau) and random walk (its standard deviation about its mean over the
  /// run) as large as the white noise of a pose mean, and a static record of 10 min.
  bool coloured = false;
};
std::string to_string(const Converter& converter);

/// The converters of the study: a fine one, the paper's with noise of one and of half a step, and
/// the fine one with coloured noise.
const std::vector<Converter>& converters();

/// One calibrated unit.
struct UnitOutcome {
  ParameterVector normalised_error;         ///< (batch estimate − truth)/u
  ParameterVector filter_normalised_error;  ///< the same of the eight-state filter
  double nees = 0;  ///< normalised estimation error squared e'·P⁻¹·e, χ² with 12 degrees
  PerAxis<double> en{};  ///< largest E_n between filter and batch
  Verdict verdict = Verdict::undetermined;
};

/// Which units are simulated and calibrated: those with the seeds first_seed … first_seed + units −
/// 1. Each has a static record of 100 s and 40 samples a pose.
struct UnitSeries {
  std::uint64_t first_seed = 1;
  int units = 200;
  double delta_step_deg = 10;  ///< of the grid; 10° gives 324 poses, 20° half of them
  int threads = 1;             ///< changes the time, not the outcome
};

/// One outcome per unit, in the order of the seeds. Aborts when the world files of the simulated
/// rig cannot be read.
std::vector<UnitOutcome> calibrate_units(const Converter& converter, const UnitSeries& series);

/// Shares are between 0 and 1.
struct Coverage {
  int units = 0;
  ParameterVector share;        ///< of the units, within ±1.96·u
  ParameterVector share_k2;     ///< of the units, within ±2·u
  ParameterVector mean;         ///< of the normalised errors: 0 when unbiased
  ParameterVector sd;           ///< of the normalised errors: 1 when u is right
  double overall_share = 0;     ///< of all parameters, within ±1.96·u
  double overall_share_k2 = 0;  ///< of all parameters, within ±2·u
  double filter_share = 0;      ///< of all parameters as the filter has them, within ±1.96·u
  /// Standard uncertainty of overall_share, from its scatter between units: the parameters of one
  /// unit are correlated.
  double u_overall_share = 0;
  double mean_nees = 0;
  double en_within_share = 0;  ///< of all axes, E_n ≤ 1
  double largest_en = 0;
  double unexplained_share = 0;  ///< of the units: a false alarm each
  double undecided_share = 0;    ///< of the units: neither clean nor unexplained
};
/// Precondition: at least two outcomes.
Coverage summarise(const std::vector<UnitOutcome>& outcomes);

/// Where a quantity lies with a stated probability.
struct Interval {
  double lower = 0;
  double upper = 0;
};
/// Of the share of `count` independent values within their 95 % interval; normal approximation of
/// the binomial distribution.
Interval binomial_interval(int count, double probability);
/// Of the mean NEES of `units` units: units·mean is χ² with 12·units degrees of freedom.
Interval nees_interval(int units, double probability);

}  // namespace plumbline::study
