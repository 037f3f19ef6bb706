#include "estimator/effects/visit_log.h"

#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <numeric>

#include "estimator/angle_units.h"
#include "estimator/fit/rounding.h"
#include "estimator/parallel_for.h"
#include "estimator/pose_means.h"

namespace plumbline {
namespace {

double mean_of(const std::vector<double>& column, const Pose& pose) {
  const auto begin = column.begin() + static_cast<std::ptrdiff_t>(pose.first);
  return std::accumulate(begin, begin + static_cast<std::ptrdiff_t>(pose.count), 0.0) /
         static_cast<double>(pose.count);
}

/// White noise of one reading from the quietest quarter of the dwells, which no faulty bit
/// disturbs.
double quiet_scatter_V(const MeasurementSet& set, std::size_t axis) {
  const std::vector<double>& u_V = set.samples.u_V[axis];
  std::vector<double> variance_V2;
  for (const Pose& pose : set.poses) {
    if (pose.count < 2) continue;
    const Eigen::Map<const Eigen::ArrayXd> dwell(u_V.data() + pose.first,
                                                 static_cast<Eigen::Index>(pose.count));
    // Quartile of χ²/dof (Wilson & Hilferty, 1931).
    const double dof = static_cast<double>(pose.count - 1), spread = 2 / (9 * dof);
    const double quartile = std::pow(1 - spread - 0.674 * std::sqrt(spread), 3);
    variance_V2.push_back((dwell - dwell.mean()).square().sum() / (dof * quartile));
  }
  if (variance_V2.empty()) return 0;
  const auto quarter = variance_V2.begin() + std::ssize(variance_V2) / 4;
  std::nth_element(variance_V2.begin(), quarter, variance_V2.end());
  return std::sqrt(*quarter);
}

/// The 12-parameter model of one axis by plain least squares.
struct PlainFit {
  Eigen::Vector4d value;   ///< K_x, K_y, K_z, U_0
  Eigen::VectorXd left_V;  ///< of the means
};
PlainFit plain_fit(const VisitLog& log, std::size_t axis) {
  Eigen::MatrixXd A(std::ssize(log.visits), 4);
  Eigen::VectorXd mean_V(A.rows());
  for (Eigen::Index k = 0; k < A.rows(); ++k) {
    const Visit& visit = log.visits[static_cast<std::size_t>(k)];
    A.row(k) << specific_force_g({visit.delta_rad, visit.h_rad}, log.gamma).transpose(), 1;
    mean_V(k) = visit.mean_V[axis];
  }
  const Eigen::Vector4d value = A.colPivHouseholderQr().solve(mean_V);
  return {value, mean_V - A * value};
}

/// What an axis sees at every visit when one of kSwinging is moved a little, over the square of its
/// noise.
Eigen::VectorXd seen_of(double HeadGeometry::*moved, const VisitLog& log, std::size_t axis,
                        const Eigen::Vector4d& value) {
  Eigen::VectorXd seen_V(std::ssize(log.visits));
  for (Eigen::Index k = 0; k < seen_V.size(); ++k) {
    const Visit& visit = log.visits[static_cast<std::size_t>(k)];
    seen_V(k) =
        value.head<3>().dot(slope_g_per_rad({visit.delta_rad, visit.h_rad}, moved, log.gamma));
  }
  const double variance_V2 = log.sample_sd_V[axis] * log.sample_sd_V[axis];
  return variance_V2 > 0 ? Eigen::VectorXd(seen_V / variance_V2)
                         : Eigen::VectorXd::Zero(seen_V.size());
}

/// What is removed as slow leaves of a strong line that hardly changes within a dwell what looks
/// like a weak one; the means show of one that does change less than there is.
std::optional<DwellLine> stronger(const std::optional<DwellLine>& through,
                                  const std::optional<DwellLine>& between) {
  constexpr double kClearly = 2;
  if (!through || !between) return through ? through : between;
  return between->amplitude_V > kClearly * through->amplitude_V ? between : through;
}

/// What a line adds to half the mean square of the differences between neighbouring samples.
double between_samples_V2(const DwellLine& line, double step_s) {
  const double size_V = line.amplitude_V * std::sin(std::numbers::pi * line.f_hz * step_s);
  return size_V * size_V;
}

/// Whether within a dwell a line cannot be told from a disturbance that is part of the noise.
bool is_in_noise(const DwellLine& line, const Visit& visit, const std::vector<NarrowBand>& bands) {
  constexpr double kPeriods = 1.5;  // more, or fewer, in a dwell
  const double seen_hz = alias_hz(line.f_hz, visit.step_s);
  return std::any_of(bands.begin(), bands.end(), [&](const NarrowBand& band) {
    return std::abs(seen_hz - band.f_hz) * visit.duration_s() < kPeriods;
  });
}

/// Whether anything lacks a bit that never changes. Where positions give few different readings of
/// an axis, all of them may have a bit alike by chance, and then the model explains them.
bool is_missed(const StuckBit& stuck, const VisitLog& log, const MeasurementSet& set,
               std::size_t axis) {
  constexpr double kSmooth = 8;    // times the noise of a reading, below which noise hides the bit
  constexpr double kNothing = 20;  // times what is left
  if (stuck.is_jumped_over) return true;
  const double weight_V = std::ldexp(log.adc->lsb_V(), stuck.bit);
  const Eigen::VectorXd left_V = plain_fit(log, axis).left_V;
  const double left_rms_V = std::sqrt(left_V.squaredNorm() / static_cast<double>(left_V.size()));
  return weight_V < kSmooth * white_scatter_V(set, axis) || weight_V < kNothing * left_rms_V;
}

/// White noise before the converter.
double input_scatter_V(const MeasurementSet& set, const VisitLog& log, std::size_t axis) {
  const double lsb_V = log.adc->lsb_V();
  if (log.codes[axis].stuck_bits.empty()) {
    const auto& lattice = log.codes[axis].coarser_lattice;
    return sd_before_rounding_V(lattice ? lattice->step_V : lsb_V, log.sample_sd_V[axis]);
  }
  // Without its lowest bit a converter has steps of twice the size.
  if (log.codes[axis].stuck_bits.front().bit == 0)
    return sd_before_rounding_V(2 * lsb_V, log.sample_sd_V[axis]);
  return sd_before_rounding_V(lsb_V, quiet_scatter_V(set, axis));
}

}  // namespace

Eigen::MatrixXd step_contrasts(std::size_t samples) {
  constexpr int kSteps = 5;
  const auto n = static_cast<Eigen::Index>(samples);
  Eigen::MatrixXd contrasts = Eigen::MatrixXd::Zero(n, kSteps);
  Eigen::Index used = 0, edge = 0;
  for (int halvings = kSteps; halvings > 0; --halvings) {
    const Eigen::Index next = n >> halvings;
    if (next <= edge) continue;
    edge = next;
    Eigen::VectorXd step = Eigen::VectorXd::Zero(n);
    step.head(edge).setOnes();
    step.array() -= step.mean();
    for (Eigen::Index k = 0; k < used; ++k) step -= contrasts.col(k).dot(step) * contrasts.col(k);
    contrasts.col(used++) = step.normalized();
  }
  return contrasts;
}

Eigen::MatrixXd contrasts_of(const Visit& visit, const VisitLog& log) {
  Eigen::MatrixXd contrasts = step_contrasts(visit.count);
  const auto add = [&](Eigen::VectorXd column) {
    constexpr double kResolved = 1e-3;  // of its length, beside the columns before it
    const double length = column.norm();
    column.array() -= column.mean();
    for (int twice = 0; twice < 2; ++twice) column -= contrasts * (contrasts.transpose() * column);
    const bool resolved = column.norm() > kResolved * length;
    contrasts.conservativeResize(Eigen::NoChange, contrasts.cols() + 1);
    contrasts.rightCols<1>() =
        resolved ? column.normalized().eval() : Eigen::VectorXd::Zero(contrasts.rows()).eval();
  };
  const auto add_line = [&](const std::optional<DwellLine>& line) {
    if (!line) return;
    const Eigen::ArrayXd phase =
        2 * std::numbers::pi * line->f_hz * visit.step_s *
        Eigen::ArrayXd::LinSpaced(contrasts.rows(), 0, static_cast<double>(visit.count - 1));
    add(phase.sin().matrix());
    add(phase.cos().matrix());
  };
  for (const auto& line : log.line) add_line(line);
  for (const auto& line : log.swinging_line) add_line(line);
  for (const auto& event : log.event) {
    if (!event) continue;
    Eigen::VectorXd course(contrasts.rows());
    for (Eigen::Index m = 0; m < course.size(); ++m)
      course(m) = event->contains(static_cast<std::size_t>(m)) ? 1 : 0;
    add(std::move(course));
  }
  return contrasts;
}

namespace {

std::array<int, 3> direction_of_arrival(const VisitLog& log, std::size_t visit) {
  const Visit* before = log.before(visit);
  return before ? direction_after(*before, log.visits[visit].delta_rad) : std::array<int, 3>{};
}

void set_directions(VisitLog& log) {
  for (std::size_t k = 0; k < log.visits.size(); ++k)
    log.visits[k].delta_direction = direction_of_arrival(log, k);
}

}  // namespace

double shorter_turn_rad(const Visit& from, const Visit& to) {
  return std::remainder(commanded_turn_rad(from, to), 2 * std::numbers::pi);
}

int last_direction_of_h(const VisitLog& log, std::size_t visit) {
  constexpr double kMoved_rad = 1e-9;
  for (; log.before(visit) != nullptr; --visit) {
    const double change_rad = log.visits[visit].h_rad - log.before(visit)->h_rad;
    if (std::abs(change_rad) >= kMoved_rad) return change_rad > 0 ? 1 : -1;
  }
  return 0;
}

std::array<int, 3> direction_after(const Visit& before, double delta_rad) {
  constexpr double kStill_rad = 1e-9;  // degrees that became radians and came back
  std::array<int, 3> direction = before.delta_direction;
  const double commanded = delta_rad - before.delta_rad;
  double shorter = std::remainder(commanded, 2 * std::numbers::pi), other = shorter;
  if (std::abs(std::abs(shorter) - std::numbers::pi) < kStill_rad) {
    shorter = commanded;
    other = -commanded;
  }
  const std::array<double, 3> turn = {shorter, commanded, other};
  for (std::size_t way = 0; way < direction.size(); ++way)
    if (std::abs(turn[way]) > kStill_rad) direction[way] = turn[way] > 0 ? 1 : -1;
  return direction;
}

std::vector<std::string> VisitLog::lacking(std::vector<std::string> columns) const {
  std::erase_if(columns, [&](const std::string& name) {
    if (name == kTemperatureColumn) return has_temperature;
    return std::find(covariate_names.begin(), covariate_names.end(), name) != covariate_names.end();
  });
  return columns;
}

RunHistory history_of(const VisitLog& log) {
  return {log.has_temperature, log.covariate_names, log.visits};
}

VisitLog log_of(const RunHistory& history) {
  VisitLog log;
  log.has_temperature = history.has_temperature;
  log.covariate_names = history.covariate_names;
  log.visits = history.visits;
  set_directions(log);
  return log;
}

void put_in_front(const RunHistory& history, BetweenSets head, VisitLog& log) {
  if (history.visits.empty() || history.visits.back().t_mean_s >= log.first_s()) return;
  if (log.has_temperature && !history.has_temperature) return;
  std::vector<std::size_t> column;  // of the log in the history
  for (const std::string& name : log.covariate_names) {
    const auto& known = history.covariate_names;
    column.push_back(
        static_cast<std::size_t>(std::find(known.begin(), known.end(), name) - known.begin()));
    if (column.back() == known.size()) return;
  }
  std::vector<Visit> all;
  for (const Visit& earlier : history.visits) {
    Visit visit = log.visits.front();
    visit.t_mean_s = earlier.t_mean_s;
    visit.t_arrival_s = visit.t_mean_s - 0.5 * visit.step_s * static_cast<double>(visit.count - 1);
    visit.delta_rad = earlier.delta_rad;
    visit.h_rad = earlier.h_rad;
    visit.temperature_K = earlier.temperature_K;
    for (std::size_t c = 0; c < column.size(); ++c)
      visit.covariate[c] = earlier.covariate[column[c]];
    all.push_back(std::move(visit));
  }
  if (head == BetweenSets::home) {
    Visit home = all.back();
    home.delta_rad = home.h_rad = 0;
    home.t_mean_s = home.t_arrival_s = 0.5 * (home.t_mean_s + log.first_s());
    all.push_back(std::move(home));
  }
  log.visits.insert(log.visits.begin(), all.begin(), all.end());
  log.earlier = all.size();
  log.moved_since = head == BetweenSets::anywhere;
  log.homed_since = head == BetweenSets::home;
  set_directions(log);
}

double VisitLog::step_V(std::size_t axis) const {
  if (!adc) return smallest_step_V[axis];
  if (codes[axis].coarser_lattice) return codes[axis].coarser_lattice->step_V;
  int missing = 0;
  for (const StuckBit& stuck : codes[axis].stuck_bits) missing = std::max(missing, stuck.bit + 1);
  return std::ldexp(adc->lsb_V(), missing);
}

bool VisitLog::is_coarse() const {
  const auto tells_noise = [](const Visit& visit) { return visit.count > 1; };
  if (!adc || std::none_of(visits.begin(), visits.end(), tells_noise)) return false;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (is_coarse_against(step_V(i), sample_sd_V[i])) return true;
  return false;
}

namespace {

/// Only even codes: rounding to twice the step, or the lowest bit held at 0. The readings are the
/// same, and one axis may have either; three bits that are all held at 0 are one converter that has
/// a bit less than declared.
bool rounds_or_lacks_the_lowest_bit(const CodeFaults& codes) {
  return codes.coarser_lattice && codes.stuck_bits.size() == 1 &&
         codes.stuck_bits.front().bit == 0 && !codes.stuck_bits.front().value;
}

}  // namespace

VisitLog make_visit_log(const MeasurementSet& set, const RunDescription& description,
                        const std::vector<NarrowBand>& bands) {
  const SampleTable& samples = set.samples;
  VisitLog log;
  log.gamma = description.gravity.local_mps2 / kStandardGravity_mps2;
  if (description.adc) log.adc = aligned_with(samples, *description.adc);
  log.goes_as_commanded = description.goes_as_commanded;
  log.has_temperature = !samples.temp_C.empty();
  log.reference_C = description.reference_C;
  for (const Covariate& covariate : samples.covariates) {
    log.covariate_names.push_back(covariate.name);
  }
  for (const Pose& pose : set.poses) {
    assert(pose.count > 0);
    Visit visit;
    visit.delta_rad = pose.delta_deg * kRadPerDeg;
    visit.h_rad = pose.h_deg * kRadPerDeg;
    visit.count = pose.count;
    visit.t_arrival_s = samples.t_s[pose.first];
    visit.step_s = pose.count > 1 ? (samples.t_s[pose.first + pose.count - 1] - visit.t_arrival_s) /
                                        static_cast<double>(pose.count - 1)
                                  : 0;
    visit.t_mean_s = mean_of(samples.t_s, pose);
    if (log.has_temperature) {
      visit.temperature_K = mean_of(samples.temp_C, pose) - description.reference_C;
    }
    for (const Covariate& covariate : samples.covariates) {
      visit.covariate.push_back(mean_of(covariate.value, pose));
    }
    for (std::size_t i = 0; i < kAxisCount; ++i) visit.mean_V[i] = mean_of(samples.u_V[i], pose);
    log.visits.push_back(std::move(visit));
    log.visits.back().delta_direction = direction_of_arrival(log, log.visits.size() - 1);
  }
  if (log.adc) {
    parallel_for(kAxisCount, [&](std::size_t i) {
      log.codes[i] = code_faults(set, i, *log.adc);
      std::erase_if(log.codes[i].stuck_bits,
                    [&](const StuckBit& stuck) { return !is_missed(stuck, log, set, i); });
    });
    if (std::all_of(log.codes.begin(), log.codes.end(), rounds_or_lacks_the_lowest_bit))
      for (CodeFaults& codes : log.codes) codes.stuck_bits.clear();
  }
  std::vector<PerAxis<Eigen::VectorXd>> seen(kSwinging.size());
  parallel_for(kAxisCount, [&](std::size_t i) {
    log.sample_sd_V[i] = log.input_sd_V[i] = white_scatter_V(set, i);
    if (log.adc) log.input_sd_V[i] = input_scatter_V(set, log, i);
    log.smallest_step_V[i] = smallest_step(samples.u_V[i]);
    const auto [low, high] = std::minmax_element(samples.u_V[i].begin(), samples.u_V[i].end());
    log.lowest_V[i] = *low;
    log.highest_V[i] = *high;
    const PlainFit fit = plain_fit(log, i);
    for (std::size_t k = 0; k < kSwinging.size(); ++k)
      seen[k][i] = seen_of(kSwinging[k], log, i, fit.value);
    log.event[i] = event_in_dwells(set, i);
    log.line[i] = stronger(line_through_dwells(set, i), line_between_dwells(set, fit.left_V));
    if (!log.line[i]) return;
    log.line_V2[i] = between_samples_V2(*log.line[i], log.visits.front().step_s);
    if (is_in_noise(*log.line[i], log.visits.front(), bands)) log.line[i].reset();
  });
  const auto lines = lines_of_all(set, seen);
  std::copy(lines.begin(), lines.end(), log.swinging_line.begin());
  for (const Visit& visit : log.visits)
    if (!log.contrasts.contains(visit.count))
      log.contrasts.emplace(visit.count, contrasts_of(visit, log));
  return log;
}

}  // namespace plumbline
