#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Bias that jumps once: b for t ≥ t0. Between two poses the instant cannot be told.
class BiasStep final : public Effect {
 public:
  std::string id() const override { return "sensor.bias_step"; }
  Subject subject() const override { return Subject::sensor; }
  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"b", "g", ParameterRole::amplitude}, {"t0", "s", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    std::vector<Hypothesis> starts;
    for (std::size_t k = 1; k < log.visits.size(); ++k) {
      starts.push_back({{effect::kSmallTerm, log.visits[k].t_arrival_s}});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    return input.at().t_mean_s >= p[1] ? p[0] : 0;
  }
};

}  // namespace

const Effect& sensor_bias_step() {
  static const BiasStep instance;
  return instance;
}

}  // namespace plumbline
