#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Rounding to a step that the description of the run does not declare.
class Quantization final : public Effect {
 public:
  std::string id() const override { return "adc.quantization"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"lsb", "V", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    const double step_V = log.smallest_step_V[axis];
    const bool declared = log.adc && step_V < 1.5 * log.adc->lsb_V();
    // Noise of more than a step hides rounding from the means.
    if (declared || step_V == 0 || log.sample_sd_V[axis] > 0.7 * step_V) return {};
    return {{{step_V}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double lsb_V = p[0];
    return effect::mean_over_noise(
               [lsb_V](double u_V) { return std::round(u_V / lsb_V) * lsb_V - u_V; },
               input.output_V, input.log.sample_sd_V[input.axis]) /
           input.K_V_per_g;
  }
};

}  // namespace

const Effect& adc_quantization() {
  static const Quantization instance;
  return instance;
}

}  // namespace plumbline
