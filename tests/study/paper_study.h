// The experiment of Kostyuk & Lakoza (2012) on simulated units: 36 × 9 positions ring by ring, 12
// bits over 5 V, the published coefficients as truth.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::study {

/// K_ix K_iy K_iz V/g, U_i0 V, as the paper has them.
const std::array<Eigen::Vector4d, kAxisCount>& paper_coefficients();

/// How each of many units estimates one coefficient.
struct Spread {
  double mean = 0;
  double sd = 0;
};
using CoefficientSpread = std::array<std::array<Spread, 4>, kAxisCount>;

/// "Settled": the first number of positions from which on the estimate of K_xx stays within 1 % of
/// the truth.
struct SettlingRow {
  std::string recursive;  ///< how recursive least squares starts
  std::string filter;     ///< how the filter starts
  std::string noise;
  double recursive_positions = 0;  ///< median over the units
  double filter_positions = 0;
  double ratio() const { return recursive_positions / filter_positions; }
};

/// Error of one measured component of acceleration at the positions, m/s².
struct ReadingError {
  double rms = 0;
  double p95 = 0;  ///< of the absolute value
  double largest = 0;
};

struct PaperStudy {
  int units = 0;
  double sigma_steps = 0;                ///< white noise of a reading
  CoefficientSpread least_squares;       ///< one reading a position
  CoefficientSpread filter;              ///< one reading a position
  CoefficientSpread intervals;           ///< one reading a position, interval likelihood
  CoefficientSpread many_least_squares;  ///< 100 readings a position
  CoefficientSpread many_intervals;
  /// RMS over the sphere of what the parameters do wrong, m/s²: in the order of the members above.
  std::array<double, 5> parameter_error_mps2{};
  ReadingError one_reading;    ///< least squares, a single reading
  ReadingError many_readings;  ///< interval likelihood, mean of 100
  std::vector<SettlingRow> settling;
  /// Of the first unit: K_xx after 1, 2 … positions.
  std::vector<double> recursive_course, diffuse_course, filter_course, printed_course;
  /// Of the first unit: absolute error of a_x at each position, m/s².
  std::vector<double> error_one, error_many;
};

/// Units with seeds first_seed … on all cores; the result does not depend on their number.
PaperStudy study_paper(int units, std::uint64_t first_seed);

/// The page: figures 2, 3 and 4 and the table, the paper's figures beside ours.
std::string paper_page(const PaperStudy& study);

}  // namespace plumbline::study
