#include <algorithm>
#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Clipping at ±L. L enters as the limit itself; beyond the largest response it is no effect. What
// is clipped is the response to all components, or (a stop of the proof mass ahead of what mixes
// the axes) that to the component along the axis alone.
class Saturation final : public Effect {
 public:
  std::string id() const override { return "sensor.saturation"; }
  Subject subject() const override { return Subject::sensor; }
  bool quiets() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"L", "g", ParameterRole::shape},
            {.name = "alone", .unit = "", .role = ParameterRole::index, .unrecorded = true}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kSteps = 16;
    std::vector<Hypothesis> starts;
    for (const double alone : {0.0, 1.0}) {
      for (int step = 0; step < kSteps; ++step) starts.push_back({{0.5 + 0.03 * step, alone}});
      // Near the largest response few readings tell one limit from the next.
      for (const double L_g : {0.965, 0.98, 0.99}) starts.push_back({{L_g, alone}});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double L_g = std::abs(p[0]);
    const double clipped_g = p[1] > 0.5 ? input.a() : input.response_g;
    return std::clamp(clipped_g, -L_g, L_g) - clipped_g;
  }
};

}  // namespace

const Effect& sensor_saturation() {
  static const Saturation instance;
  return instance;
}

}  // namespace plumbline
