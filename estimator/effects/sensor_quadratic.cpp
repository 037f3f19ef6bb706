#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Second-order nonlinearity K2 (IEEE 1293): k2·a_i².
class Quadratic final : public Effect {
 public:
  std::string id() const override { return "sensor.quadratic"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"k2", "g/g^2", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * input.a() * input.a();
  }
};

}  // namespace

const Effect& sensor_quadratic() {
  static const Quadratic instance;
  return instance;
}

}  // namespace plumbline
