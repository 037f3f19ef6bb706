#include "estimator/effects/effect.h"

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
    return {{"amplitude", "g", ParameterRole::amplitude},
            effect::line_frequency(),
            effect::line_phase()};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    const auto& line = log.line[axis];
    if (!line || !line->steady) return {};
    return {{{effect::kSmallTerm, line->f_hz, effect::start_of_phase_deg(*line)}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * effect::mean_of_sine(input.at(), p[1], p[2]);
  }
  void normalise(std::vector<double>& p) const override { effect::normalise_sine(p[0], p[2]); }
  bool within_dwell() const override { return true; }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return p[0] * effect::sine(input.at(), p[1], p[2]);
  }
};

}  // namespace

const Effect& adc_mains_pickup() {
  static const MainsPickup instance;
  return instance;
}

}  // namespace plumbline
