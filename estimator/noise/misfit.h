// How far a record's spectrum is from its description, and where no description holds.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/noise/spectrum_sums.h"
#include "estimator/noise/term_choice.h"

namespace plumbline {

/// A description whose deviations are less likely than this is called inadequate.
inline constexpr double kInadequate = 1e-3;

/// Deviations of the spectrum from a description.
struct Misfit {
  double chi2 = 0;  ///< one value a bin of at least 8 coefficients
  double dof = 1;
  double octave_chi2 = 0;  ///< one value an octave
  double octave_dof = 1;
  double slope_z = 0;      ///< of the ratio over the upper two octaves, in standard deviations
  double worst_ratio = 1;  ///< of an octave that is well known, or its inverse
  double p_value() const;
  double octave_p_value() const;
  bool adequate() const;
  bool doubtful() const;
};

/// `variance`: of each bin, U²; `slope`: of the ramp; `parameters`: how many were fitted.
Misfit measure_misfit(const SpectrumSums& sums, const Eigen::VectorXd& variance, double slope,
                      double parameters);
Misfit misfit_of(const SpectrumSums& sums, const TermDescription& description);

/// The bins but for those that stand clearly above the description, where they are few: resonances
/// and skirts of disturbances, which none of the terms is meant for.
SpectrumSums without_humps(const SpectrumSums& sums, const TermDescription& description);

/// Where the record's bandwidth ends: the highest frequency below which the spectrum does not fall
/// off at its upper end more than the terms do. The Nyquist frequency when it does not fall at all.
double find_band_hz(const std::vector<double>& c, double rate_hz, const std::vector<bool>& masked);

}  // namespace plumbline
