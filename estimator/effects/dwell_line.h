// A sine that runs through all dwells with one frequency and one phase, as mains pickup does.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// amplitude·sin(2π·f·t + phase) in the readings, t on the clock of the run.
struct DwellLine {
  double f_hz = 0;  ///< at most half the sampling rate where the arrivals do not tell it from its
                    ///< alias there
  double amplitude_V = 0;
  double phase_rad = 0;  ///< 0 … 2π
  bool steady = true;  ///< as strong at the end of a dwell as at its beginning, and not begun by it
};

/// The frequency, up to half the rate of readings `step_s` apart, at which these show a line.
inline double alias_hz(double f_hz, double step_s) {
  return std::abs(std::remainder(f_hz, 1 / step_s));
}

/// The line of one axis that noise would not often show (once in 10⁵ sets), if there is one. Looked
/// for where its alias has 1.5 periods a dwell or more: first by the power within the dwells,
/// whatever their phases, then at the strongest frequencies, and at those of which they are the
/// alias, by the sum over all dwells with one phase, which is judged against the power of those
/// same dwells (Schuster's test), so that the colour of the noise does not matter. Empty for dwells
/// of few samples.
std::optional<DwellLine> line_through_dwells(const MeasurementSet& set, std::size_t axis);

/// The same for lines of what the axes see as they stand to it, an angle of the head that swings:
/// in the sum of the axes' courses, each times what it sees of that at the pose over the square of
/// its noise, one for each of `seen`. Of the results the amplitude means nothing.
std::vector<std::optional<DwellLine>> lines_of_all(
    const MeasurementSet& set, const std::vector<PerAxis<Eigen::VectorXd>>& seen);

/// The same for a line so near a multiple of the sampling rate that it hardly changes within a
/// dwell: in what the mean of each pose leaves of the 12-parameter model, V.
std::optional<DwellLine> line_between_dwells(const MeasurementSet& set,
                                             const Eigen::VectorXd& left_V);

}  // namespace plumbline
