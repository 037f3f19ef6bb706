// How well do codes tell the parameters? Simulated poses of one axis on the paper's grid and
// converter (12 bits over 5 V at 0.032 V/g: a step of 0.374 m/s²), with known truth.
#pragma once

#include <cstdint>
#include <string>

namespace plumbline::study {

struct CodeCase {
  double sigma = 0;               ///< noise of a reading before rounding, steps
  int readings = 1;               ///< a pose
  double positioning_arcsec = 0;  ///< standard deviation of both angles of each pose, undeclared
  double nonlinearity = 0;        ///< peak error of a code boundary, steps
};
std::string to_string(const CodeCase& c);

/// RMS over the sphere of the error that the estimated parameters make, mm/s².
struct CodeErrors {
  double least_squares = 0;  ///< of mean voltages
  double first_order = 0;    ///< of means freed of rounding to first order (fit/rounding.h)
  double chosen = 0;         ///< as calibrate() does it: interval likelihood where it applies
  double coverage = 0;       ///< share of the four parameters within 1.96 u, chosen
  double sigma = 0;          ///< mean of the noise found, steps; 0 where the codes were not used
};

/// Seeds first_seed … first_seed + trials − 1, on all cores; the result does not depend on them.
CodeErrors study_codes(const CodeCase& c, int trials, std::uint64_t first_seed);

}  // namespace plumbline::study
