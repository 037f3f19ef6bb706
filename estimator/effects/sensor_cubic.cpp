#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Third-order nonlinearity K3 (IEEE 1293): k3·a_i³.
class Cubic final : public Effect {
 public:
  std::string id() const override { return "sensor.cubic"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"k3", "g/g^3", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * input.a() * input.a() * input.a();
  }
};

}  // namespace

const Effect& sensor_cubic() {
  static const Cubic instance;
  return instance;
}

}  // namespace plumbline
