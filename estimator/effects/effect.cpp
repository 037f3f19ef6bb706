#include "estimator/effects/effect.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "estimator/noise/chi_squared.h"
#include "estimator/noise/covariance.h"

namespace plumbline {

void Effect::displace(const VisitLog&, std::size_t, const double*, HeadGeometry&) const {}

double Effect::term_g(const TermInput&, const double*) const { return 0; }

void Effect::displace_by_number(const VisitLog&, std::size_t, double, const double*,
                                HeadGeometry&) const {}

Eigen::VectorXd Effect::course_g(const TermInput& input, const double* p) const {
  return Eigen::VectorXd::Constant(static_cast<Eigen::Index>(input.at().count), term_g(input, p));
}

AngleCourse Effect::angle_course(const VisitLog& log, std::size_t visit, const double*) const {
  return {&HeadGeometry::delta_rad,
          Eigen::VectorXd::Zero(static_cast<Eigen::Index>(log.visits[visit].count))};
}

namespace effect {

double share_below(double edge, double value, double sd) {
  if (!(sd > 0)) return value < edge ? 1 : 0;
  return normal_below((edge - value) / sd);
}

double share_with_bit(double value, double sd, bool set) {
  const double first = std::floor(value - kReach * sd);
  // Counted: where a fit strays to 1e16 steps, one more is the same number.
  const int steps = whole_numbers(first, value + kReach * sd);
  double share = 0;
  for (int k = 0; k < steps; ++k) {
    const double from = first + k;
    if ((std::fmod(std::abs(from), 2) == 1) == set)
      share += share_below(from + 1, value, sd) - share_below(from, value, sd);
  }
  return share;
}

namespace {

std::complex<double> turn_of_sample(const Visit& visit, const double* p) {
  return std::exp(visit.step_s * std::complex<double>(-1 / p[1], kTurn_rad * p[0]));
}

}  // namespace

Eigen::VectorXd ringing(const Visit& visit, const double* p) {
  const std::complex<double> turn = turn_of_sample(visit, p);
  std::complex<double> now = 1;
  Eigen::VectorXd values(static_cast<Eigen::Index>(visit.count));
  for (double& value : values) {
    value = p[2] * now.real() + p[3] * now.imag();
    now *= turn;
  }
  return values;
}

double mean_of_ringing(const Visit& visit, const double* p) {
  const std::complex<double> turn = turn_of_sample(visit, p);
  const auto n = static_cast<double>(visit.count);
  const std::complex<double> mean = (1.0 - std::pow(turn, n)) / (1.0 - turn) / n;
  return p[2] * mean.real() + p[3] * mean.imag();
}

std::vector<Hypothesis> starts_of_ringing(const Visit& visit) {
  constexpr double kLeastPeriods = 1, kMostOfRate = 0.4;
  constexpr std::size_t kFewestSamples = 16;
  const double dwell_s = visit.duration_s();
  std::vector<Hypothesis> starts;
  if (!(dwell_s > 0) || visit.count < kFewestSamples) return starts;
  for (const double f_hz : geometric(kLeastPeriods / dwell_s, kMostOfRate / visit.step_s, 8))
    for (const double part : {0.1, 0.4}) starts.push_back({{f_hz, part * dwell_s, 1, 1}});
  return starts;
}

// Over a run of hours the phase at its end must change by little only.
ParameterInfo line_frequency() { return {"f", "Hz", ParameterRole::shape, 1e-7}; }
ParameterInfo line_phase() { return {"phase", "deg", ParameterRole::shape, 1e-2}; }

double start_of_phase_deg(const DwellLine& line) {
  const double phase_deg = line.phase_rad / kRadPerDeg;
  return phase_deg < 180 ? phase_deg + 360 : phase_deg;
}

namespace {
double phase_of_first_sample_rad(const Visit& visit, double f_hz, double phase_deg) {
  return kTurn_rad * (f_hz * visit.t_arrival_s + phase_deg / 360);
}
}  // namespace

double mean_of_sine(const Visit& visit, double f_hz, double phase_deg) {
  const double to_middle_rad =
      0.5 * kTurn_rad * f_hz * visit.step_s * (static_cast<double>(visit.count) - 1);
  return share_of_sine({visit.t_arrival_s, visit.step_s, visit.count}, f_hz) *
         std::sin(phase_of_first_sample_rad(visit, f_hz, phase_deg) + to_middle_rad);
}

Eigen::VectorXd sine(const Visit& visit, double f_hz, double phase_deg) {
  // Turned on from sample to sample: sines one by one would be a quarter of a search's time.
  const std::complex<double> turn = std::polar(1.0, kTurn_rad * f_hz * visit.step_s);
  std::complex<double> phasor = std::polar(1.0, phase_of_first_sample_rad(visit, f_hz, phase_deg));
  Eigen::VectorXd course(static_cast<Eigen::Index>(visit.count));
  for (double& value : course) {
    value = phasor.imag();
    phasor *= turn;
  }
  return course;
}

void normalise_sine(double& amplitude, double& phase_deg) {
  if (amplitude < 0) phase_deg += 180;
  amplitude = std::abs(amplitude);
  phase_deg -= 360 * std::floor(phase_deg / 360);
}

Hypothesis harmonic(int n, int positions, double angle_rad, double size) {
  Hypothesis start{{static_cast<double>(n), size, size}};
  const bool cosine = std::abs(std::cos(n * angle_rad)) > 0.5;
  if (2 * n == positions) start.p[cosine ? 2 : 1] = 0;
  return start;
}

int whole_numbers(double first, double last) {
  const double count = std::floor(last) - first + 1;
  return count >= 1 ? static_cast<int>(std::min(count, 1e9)) : 0;  // NaN: none
}

int positions_of_a_turn(std::vector<double> angles_rad) {
  constexpr double kNear_rad = 1e-3;
  std::sort(angles_rad.begin(), angles_rad.end());
  double closest_rad = kTurn_rad;
  for (std::size_t k = 1; k < angles_rad.size(); ++k)
    if (const double apart_rad = angles_rad[k] - angles_rad[k - 1]; apart_rad > kNear_rad)
      closest_rad = std::min(closest_rad, apart_rad);
  return static_cast<int>(std::lround(kTurn_rad / closest_rad));
}

Eigen::ArrayXd since_arrival_s(const Visit& visit) {
  const auto last = static_cast<Eigen::Index>(visit.count) - 1;
  return visit.step_s * Eigen::ArrayXd::LinSpaced(last + 1, 0, static_cast<double>(last));
}

Eigen::ArrayXd decay_since_arrival(const Visit& visit, double tau_s) {
  // Many time constants are tried on many samples: a product each instead of an exponential.
  const double ratio = std::exp(-visit.step_s / tau_s);
  Eigen::ArrayXd decay(static_cast<Eigen::Index>(visit.count));
  double now = 1;
  for (double& value : decay) {
    value = now;
    now *= ratio;
  }
  return decay;
}

double mean_decay(const Visit& visit, double origin_s, double tau_s) {
  const double first = std::exp(-(visit.t_arrival_s - origin_s) / tau_s);
  const double ratio = std::exp(-visit.step_s / tau_s);
  const auto n = static_cast<double>(visit.count);
  if (visit.count < 2 || 1 - ratio < 1e-12) return first;
  return first * (1 - std::pow(ratio, n)) / (n * (1 - ratio));
}

std::vector<double> geometric(double first, double last, int count) {
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k)
    values.push_back(first * std::pow(last / first, k / (count - 1.0)));
  return values;
}

}  // namespace effect
}  // namespace plumbline
