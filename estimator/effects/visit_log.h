// What is known about every visit of a position before anything is estimated: where the head was
// sent, in which order, when, and what was recorded beside the outputs. Effects are functions of
// it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "estimator/effects/code_evidence.h"
#include "estimator/effects/dwell_event.h"
#include "estimator/effects/dwell_line.h"
#include "estimator/kinematics.h"
#include "estimator/measurement.h"
#include "estimator/noise/covariance.h"

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
  /// Sign of the last turn of δ that led here, 0 before the first one: [0] for a head that goes the
  /// shorter way round, [1] for one that goes from one commanded angle to the other within the
  /// turn; [2] as [0], but half a turn, of which both ways are alike, the other way round.
  std::array<int, 3> delta_direction{};
  std::vector<double> covariate;  ///< mean over the dwell
  PerAxis<double> mean_V{};       ///< of the readings

  double duration_s() const { return step_s * static_cast<double>(count); }
};

inline constexpr const char* kTemperatureColumn = "temp_C";

/// What may swing: angles of the head; a base that is shaken to and fro is to the triad one that
/// swings, one that is shaken up and down another gravity.
inline constexpr std::array kSwinging = {&HeadGeometry::delta_rad, &HeadGeometry::h_rad,
                                         &HeadGeometry::roll_rad, &HeadGeometry::lift};

/// The visits in order and what holds for all of them.
struct VisitLog {
  std::vector<Visit> visits;
  double gamma = 1;  ///< local over standard gravity
  bool has_temperature = false;
  double reference_C = 0;                    ///< T₀
  std::vector<std::string> covariate_names;  ///< in the order of Visit::covariate
  /// Those of `columns` that were not recorded (kTemperatureColumn among them).
  std::vector<std::string> lacking(std::vector<std::string> columns) const;
  PerAxis<double> sample_sd_V{};  ///< white noise of one sample, within the dwells
  PerAxis<double> line_V2{};      ///< the part of its square that a line through the dwells is
  /// The same before the converter: freed of what rounding and stuck bits do to it.
  PerAxis<double> input_sd_V{};
  PerAxis<CodeFaults> codes;                ///< where a converter is declared
  PerAxis<double> smallest_step_V{};        ///< smallest difference between two different readings
  PerAxis<double> lowest_V{}, highest_V{};  ///< of all readings
  std::optional<Adc> adc;
  bool goes_as_commanded = false;          ///< RunDescription's
  PerAxis<std::optional<DwellLine>> line;  ///< that runs through the dwells
  /// That all axes see as if one of kSwinging swung.
  std::array<std::optional<DwellLine>, kSwinging.size()> swinging_line;
  PerAxis<std::optional<DwellEvent>> event;  ///< in every dwell
  /// What is looked for within a dwell beside its mean, for every number of samples that occurs:
  /// samples × dwell_contrasts(), orthonormal columns of zero sum; what a dwell cannot resolve is
  /// zero. The first are step_contrasts(); then come sine and cosine of every line and every event.
  std::map<std::size_t, Eigen::MatrixXd> contrasts;

  /// Visits in front that belong to an earlier set, whether the head stood elsewhere since, and
  /// whether the last of them is its rest at home.
  std::size_t earlier = 0;
  bool moved_since = false;
  bool homed_since = false;

  /// Where the head came from; null where nothing recorded says so.
  const Visit* before(std::size_t visit) const {
    const bool unknown = visit == 0 || (visit == earlier && moved_since);
    return unknown ? nullptr : &visits[visit - 1];
  }
  /// Whether the head is taken to have been there for long: nothing says that it was not.
  bool is_rest(std::size_t visit) const {
    return before(visit) == nullptr || (homed_since && visit + 1 == earlier);
  }
  /// How many numbers describe the course of a dwell beside its mean.
  Eigen::Index dwell_contrasts() const { return contrasts.begin()->second.cols(); }

  /// Step between neighbouring readings of an axis, as declared or as the codes show.
  double step_V(std::size_t axis) const;
  /// Whether some axis reads with less noise than its converter needs to average rounding away.
  bool is_coarse() const;
  double first_s() const { return visits.front().t_arrival_s; }
  double last_s() const { return visits.back().t_mean_s; }
};

/// An earlier run of the same unit, as far as effects remember it: of its visits t_mean_s, the
/// angles, temperature and covariates.
struct RunHistory {
  bool has_temperature = false;
  std::vector<std::string> covariate_names;  ///< in the order of Visit::covariate
  std::vector<Visit> visits;
};
RunHistory history_of(const VisitLog& log);
/// A log of these visits, of which nothing else is known.
VisitLog log_of(const RunHistory& history);

/// Where the head went between two sets: home is δ = h = 0.
enum class BetweenSets { nowhere, home, anywhere };

/// Puts the visits of an earlier set in front of the log's own, so that effects that remember them
/// go on where they were. Nothing is done where they were not earlier on the same clock or lack a
/// column of the log.
void put_in_front(const RunHistory& history, BetweenSets head, VisitLog& log);

/// From one visit to another: the shorter turn of δ, and the one that was commanded, of a head that
/// does not pass from 360° to 0°.
double shorter_turn_rad(const Visit& from, const Visit& to);
inline double commanded_turn_rad(const Visit& from, const Visit& to) {
  return to.delta_rad - from.delta_rad;
}

/// Sign of the last turn of h that led to a visit; 0 before the first one.
int last_direction_of_h(const VisitLog& log, std::size_t visit);

/// Visit::delta_direction of a visit at `delta_rad` that comes next after `before`.
std::array<int, 3> direction_after(const Visit& before, double delta_rad);

/// For what changes slowly within a dwell of `samples` samples: samples × 5, orthonormal columns of
/// zero sum. They span the steps after 1/32, 1/16 … 1/2 of the dwell, finest where transients after
/// a move are fastest; columns that a short dwell cannot resolve are zero.
Eigen::MatrixXd step_contrasts(std::size_t samples);

/// The contrasts of a visit's dwell: VisitLog::contrasts says which. Precondition: the lines and
/// events of the log are known.
Eigen::MatrixXd contrasts_of(const Visit& visit, const VisitLog& log);

/// Without angles those of the visits are zero. `bands`: what there is of lines near them is part
/// of the noise. Precondition: every pose has a sample.
VisitLog make_visit_log(const MeasurementSet& set, const RunDescription& description,
                        const std::vector<NarrowBand>& bands = {});

}  // namespace plumbline
