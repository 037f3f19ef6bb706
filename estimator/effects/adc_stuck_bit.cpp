#include <cmath>

#include "estimator/effects/effect.h"
#include "estimator/noise/covariance.h"

namespace plumbline {
namespace {

// One bit of the code held at 0 or 1. How far the noise of a reading rounds the steps off is
// estimated with it.
class StuckBitEffect final : public Effect {
 public:
  std::string id() const override { return "adc.stuck_bit"; }
  Subject subject() const override { return Subject::sensor; }
  bool repeats() const override { return true; }
  bool at_converter() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"bit", "", ParameterRole::index},
            {"value", "", ParameterRole::index},
            {"noise", "V", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<Hypothesis> starts;
    for (const StuckBit& stuck : log.codes[axis].stuck_bits) {
      const double noise_V = std::max(
          log.input_sd_V[axis], effect::kLeastNoise * std::ldexp(log.adc->lsb_V(), stuck.bit));
      starts.push_back({{static_cast<double>(stuck.bit), stuck.value ? 1.0 : 0.0, noise_V}});
    }
    return starts;
  }
  bool certain(const VisitLog&, std::size_t) const override { return true; }
  double term_g(const TermInput& input, const double* p) const override {
    const Adc& adc = *input.log.adc;
    // In units of the bit, counted from the lower end of the span.
    const double size_V = adc.lsb_V() * std::ldexp(1.0, static_cast<int>(p[0]));
    const double half_code = 0.5 * adc.lsb_V() / size_V;
    const double value = (input.output_V - adc.min_V) / size_V + half_code;
    const double sd = std::min(p[2] / size_V, effect::kMostNoise);
    const bool set = p[1] > 0.5;
    const double wrong = effect::share_with_bit(value, sd, !set);
    // The bit is lost after rounding, which such readings therefore are not freed of.
    const double rounding_V =
        rounding_bias(input.output_V, adc.min_V, adc.lsb_V(), std::abs(p[2])).bias;
    return (rounding_V + (set ? wrong : -wrong) * size_V) / input.K_V_per_g;
  }
};

}  // namespace

const Effect& adc_stuck_bit() {
  static const StuckBitEffect instance;
  return instance;
}

}  // namespace plumbline
