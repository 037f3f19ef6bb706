#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Linear drift of the scale factor: s·t·a_i.
class ScaleDrift final : public Effect {
 public:
  std::string id() const override { return "sensor.scale_drift"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"s", "1/h", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * input.at().t_mean_s / 3600 * input.a();
  }
};

}  // namespace

const Effect& sensor_scale_drift() {
  static const ScaleDrift instance;
  return instance;
}

}  // namespace plumbline
