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
  bool quiets() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"L", "g", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kSteps = 16;
    std::vector<Hypothesis> starts;
    starts.reserve(kSteps);
    // Near the largest response few readings tell one limit from the next.
    for (int step = 0; step < kSteps; ++step) starts.push_back({{0.5 + 0.03 * step}});
    for (const double L_g : {0.965, 0.98, 0.99}) starts.push_back({{L_g}});
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double L_g = std::abs(p[0]);
    return std::clamp(input.response_g, -L_g, L_g) - input.response_g;
  }
};

}  // namespace

const Effect& sensor_saturation() {
  static const Saturation instance;
  return instance;
}

}  // namespace plumbline
