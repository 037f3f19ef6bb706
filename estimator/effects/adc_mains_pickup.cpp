#include <cmath>
#include <complex>
#include <numbers>

#include "estimator/effects/effect.h"
#include "estimator/noise/covariance.h"

namespace plumbline {
namespace {

// Mains pickup: A·sin(2πft + φ) in every sample. It lives inside the dwell; in the means only what
// averaging leaves of it is seen. Where dwells begin a whole number of samples apart, a line cannot
// be told from its alias, and f is at most half the sampling rate.
class MainsPickup final : public Effect {
 public:
  std::string id() const override { return "adc.mains_pickup"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    // Over a run of hours the phase at its end must change by little only.
    return {{"amplitude", "g", ParameterRole::amplitude},
            {"f", "Hz", ParameterRole::shape, 1e-7},
            {"phase", "deg", ParameterRole::shape, 1e-2}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    const auto& line = log.line[axis];
    if (!line || !line->steady) return {};
    // The fit keeps the sign of a shape: from half a turn up no phase comes near zero.
    const double phase_deg = line->phase_rad / effect::kRadPerDeg;
    return {{{effect::kSmallTerm, line->f_hz, phase_deg < 180 ? phase_deg + 360 : phase_deg}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    const Visit& visit = input.at();
    const double to_middle_rad =
        0.5 * effect::kTurn_rad * p[1] * visit.step_s * (static_cast<double>(visit.count) - 1);
    return share_of_sine({visit.t_arrival_s, visit.step_s, visit.count}, p[1]) * p[0] *
           std::sin(phase_rad(visit, p) + to_middle_rad);
  }
  void normalise(std::vector<double>& p) const override {
    if (p[0] < 0) p[2] += 180;
    p[0] = std::abs(p[0]);
    p[2] -= 360 * std::floor(p[2] / 360);
  }
  bool within_dwell() const override { return true; }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    // Turned on from sample to sample: sines one by one would be a quarter of a search's time.
    const Visit& visit = input.at();
    const std::complex<double> turn = std::polar(1.0, effect::kTurn_rad * p[1] * visit.step_s);
    std::complex<double> phasor = std::polar(1.0, phase_rad(visit, p));
    Eigen::VectorXd course_g(static_cast<Eigen::Index>(visit.count));
    for (double& value_g : course_g) {
      value_g = p[0] * phasor.imag();
      phasor *= turn;
    }
    return course_g;
  }

 private:
  /// At the first sample.
  static double phase_rad(const Visit& visit, const double* p) {
    return effect::kTurn_rad * (p[1] * visit.t_arrival_s + p[2] / 360);
  }
};

}  // namespace

const Effect& adc_mains_pickup() {
  static const MainsPickup instance;
  return instance;
}

}  // namespace plumbline
