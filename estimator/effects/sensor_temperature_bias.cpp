#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Bias that follows temperature: b1·(T − T₀).
class TemperatureBias final : public Effect {
 public:
  std::string id() const override { return "sensor.temperature_bias"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"b1", "g/K", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  std::vector<std::string> columns() const override { return {kTemperatureColumn}; }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * input.at().temperature_K;
  }
};

}  // namespace

const Effect& sensor_temperature_bias() {
  static const TemperatureBias instance;
  return instance;
}

}  // namespace plumbline
