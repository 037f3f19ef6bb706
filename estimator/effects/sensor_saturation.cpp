#include <algorithm>
#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Clipping at ±L. L enters as the limit itself; beyond the largest response it is no effect.
class Saturation final : public Effect {
 public:
  std::string id() const override { return "sensor.saturation"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"L", "g", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<Hypothesis> starts;
    for (double L_g = 0.5; L_g < 1.0; L_g += 0.03) starts.push_back({{L_g}});
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double L_g = std::abs(p[0]);
    return effect::mean_over_noise([L_g](double r) { return std::clamp(r, -L_g, L_g) - r; },
                                   input.response_g,
                                   input.log.sample_sd_V[input.axis] / std::abs(input.K_V_per_g));
  }
};

}  // namespace

const Effect& sensor_saturation() {
  static const Saturation instance;
  return instance;
}

}  // namespace plumbline
