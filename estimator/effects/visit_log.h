// What is known about every visit of a position before anything is estimated: where the head was
// sent, in which order, when, and what was recorded beside the outputs. Effects are functions of
// it.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// One visit. Angles are the commanded ones.
struct Visit {
  double delta_rad = 0;
  double h_rad = 0;
  double t_arrival_s = 0;  ///< first sample
  double step_s = 0;       ///< between samples
  std::size_t count = 0;   ///< samples
  double t_mean_s = 0;
  double temperature_K = 0;  ///< mean of T − T₀; 0 when not recorded
  int delta_direction = 0;   ///< sign of the last turn of δ that led here; 0 if δ never turned
  std::vector<double> covariate;  ///< mean over the dwell
};

/// The visits in order and what holds for all of them.
struct VisitLog {
  std::vector<Visit> visits;
  double gamma = 1;  ///< local over standard gravity
  bool has_temperature = false;
  std::vector<std::string> covariate_names;  ///< in the order of Visit::covariate
  PerAxis<double> sample_sd_V{};             ///< white noise of one sample, within the dwells
  PerAxis<double> smallest_step_V{};         ///< smallest difference between two different readings
  PerAxis<double> lowest_V{}, highest_V{};   ///< of all readings
  std::optional<Adc> adc;

  double first_s() const { return visits.front().t_arrival_s; }
  double last_s() const { return visits.back().t_mean_s; }
};

/// Precondition: the set has angles, and every pose has a sample.
VisitLog make_visit_log(const MeasurementSet& set, const RunDescription& description);

/// Head and base with their errors at one visit.
struct HeadGeometry {
  double delta_rad = 0;
  double h_rad = 0;
  double roll_rad = 0;  ///< of the base about x_b
  double skew_rad = 0;  ///< of the spindle against the normal of the tilt axis
};

/// Specific force in the sensor frame, standard g. With zero roll and skew this is
/// γ·(cos h cos δ, −cos h sin δ, sin h).
Eigen::Vector3d specific_force_g(const HeadGeometry& head, double gamma);

}  // namespace plumbline
