// Power-law noise type of phase data, and the degrees of freedom of a deviation under it.
#pragma once

#include <cstddef>
#include <vector>

#include "estimator/noise/allan.h"

namespace plumbline {

/// Exponent α of the spectrum f^α of the rate, −4 … 2 (0 white, −1 flicker, −2 random walk; 2 and 1
/// are white and flicker phase, quantization like).
///
/// Lag-1 autocorrelation of the phase data taken every m-th point and differenced until stationary
/// (Riley & Greenhall, 2004; SP 1065 section 5.5.6). Needs at least 30 points so taken; `fallback`
/// is returned when there are fewer. With `differences` = 3 (Hadamard) exponents down to −4 are
/// told apart, with 2 down to −2.
int noise_exponent(const std::vector<double>& phase, std::size_t m, int differences, int fallback);

/// Equivalent degrees of freedom of a deviation at averaging factor m with `phase_points` data in
/// noise f^alpha. Difference variances: Greenhall & Riley (2003); total deviations: SP 1065
/// tables 7 and 9; outside their range α is taken at the nearest end, but for the total deviation
/// of phase noise (α > 0), which gets those of the overlapping Allan variance. At least 1.
double equivalent_degrees_of_freedom(Deviation kind, int alpha, std::size_t m,
                                     std::size_t phase_points);

/// The same for a variance of d-th differences (1, 2 Allan, 3 Hadamard), `overlapping` or not,
/// `modified` or not. Requires α + 2d > 1.
double greenhall_edf(int alpha, int d, std::size_t m, std::size_t phase_points, bool overlapping,
                     bool modified);

}  // namespace plumbline
