#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Scale factor that follows temperature: s1·(T − T₀)·a_i.
class TemperatureScale final : public Effect {
 public:
  std::string id() const override { return "sensor.temperature_scale"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"s1", "1/K", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm}}};
  }
  std::vector<std::string> columns() const override { return {kTemperatureColumn}; }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * input.at().temperature_K * input.a();
  }
};

}  // namespace

const Effect& sensor_temperature_scale() {
  static const TemperatureScale instance;
  return instance;
}

}  // namespace plumbline
