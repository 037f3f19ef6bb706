#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// A step at one code boundary: c·sign(U − U_c). Noise within the dwell rounds it off.
class CodeStep final : public Effect {
 public:
  std::string id() const override { return "adc.code_step"; }
  Subject subject() const override { return Subject::sensor; }
  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"c", "V", ParameterRole::amplitude}, {"at", "V", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<Hypothesis> starts;
    constexpr int kBoundaries = 64;
    const double low = log.lowest_V[axis], high = log.highest_V[axis];
    for (int k = 1; k < kBoundaries; ++k) {
      starts.push_back({{1e-5, low + (high - low) * k / kBoundaries}});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double at_V = p[1];
    return p[0] / input.K_V_per_g *
           effect::mean_over_noise([at_V](double u) { return u >= at_V ? 1.0 : -1.0; },
                                   input.output_V, input.log.sample_sd_V[input.axis]);
  }
};

}  // namespace

const Effect& adc_code_step() {
  static const CodeStep instance;
  return instance;
}

}  // namespace plumbline
