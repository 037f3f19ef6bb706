#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Hysteresis: ±w/2, + when a_i rose on the way to this pose, − when it fell.
class Hysteresis final : public Effect {
 public:
  std::string id() const override { return "sensor.hysteresis"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"w", "g", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    if (input.visit == 0) return 0;
    const auto i = static_cast<Eigen::Index>(input.axis);
    const double rise = input.a_g[input.visit](i) - input.a_g[input.visit - 1](i);
    if (std::abs(rise) < 1e-9) return 0;
    return rise > 0 ? p[0] / 2 : -p[0] / 2;
  }
};

}  // namespace

const Effect& sensor_hysteresis() {
  static const Hysteresis instance;
  return instance;
}

}  // namespace plumbline
