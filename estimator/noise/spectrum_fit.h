// Nonnegative noise powers fitted to a gathered spectrum, for any number of terms.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "estimator/noise/spectrum_sums.h"

namespace plumbline {

/// What is not linear in a spectrum's model. The powers that belong to it are [Q² N² B² K²], then
/// the variance of each Gauss-Markov process.
struct SpectrumShape {
  double flicker_low_hz = 0;
  double flicker_high_hz = std::numeric_limits<double>::infinity();
  std::vector<double> markov_tau_s;

  Eigen::Index terms() const { return 4 + static_cast<Eigen::Index>(markov_tau_s.size()); }
};

/// Mean variance of a coefficient of each bin, terms × bins, for powers of 1.
Eigen::MatrixXd shape_densities(const SpectrumSums& sums, const SpectrumShape& shape);

/// The rows of such a matrix that depend on the shape: B where the flicker has limits, and the
/// Gauss-Markov processes.
void fill_shape(const SpectrumSums& sums, const SpectrumShape& shape, Eigen::MatrixXd& density);

/// Maximum of the restricted Whittle likelihood, the ramp profiled out.
struct SpectrumFit {
  Eigen::VectorXd power;
  double deviance = std::numeric_limits<double>::infinity();  ///< −2 ln L but for a constant
  double slope = 0;                                           ///< of the ramp, U/s
  double slope_variance = 0;
  bool converged = false;
};

/// Fisher scoring with nonnegative powers. `density` as above. Powers whose bit in `held` is set
/// stay at their value in `start`, which has a positive sum (precondition).
SpectrumFit fit_powers(const SpectrumSums& sums, const Eigen::MatrixXd& density,
                       const Eigen::VectorXd& start, unsigned held = 0);

/// Powers to start from: each term alone explains half of the lowest place it could.
Eigen::VectorXd starting_powers(const SpectrumSums& sums, const Eigen::MatrixXd& density,
                                unsigned held = 0);

/// Fisher information about parameters with the given derivatives of the variances, parameters ×
/// bins, at `variance` (a bin each); the degree of freedom of the ramp is taken off.
Eigen::MatrixXd fisher_information(const SpectrumSums& sums, const Eigen::MatrixXd& derivative,
                                   const Eigen::VectorXd& variance);

/// Σc² of a bin freed of a ramp of the given slope.
double square_without_ramp(const SpectrumSum& bin, double slope);

}  // namespace plumbline
