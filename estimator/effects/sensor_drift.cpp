#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Linear drift of the bias: d·t.
class Drift final : public Effect {
 public:
  std::string id() const override { return "sensor.drift"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"d", "g/h", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * input.at().t_mean_s / 3600;
  }
};

}  // namespace

const Effect& sensor_drift() {
  static const Drift instance;
  return instance;
}

}  // namespace plumbline
