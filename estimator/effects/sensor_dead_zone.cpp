#include <algorithm>
#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Dead zone: the response is zero within ±w and continuous beyond.
// Its size is shape and amplitude in one: w = 0 is no effect.
class DeadZone final : public Effect {
 public:
  std::string id() const override { return "sensor.dead_zone"; }
  Subject subject() const override { return Subject::sensor; }
  bool quiets() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"w", "g", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<Hypothesis> starts;
    for (double w_g : effect::geometric(5e-4, 0.2, 12)) starts.push_back({{w_g}});
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double w_g = std::abs(p[0]);
    return -std::clamp(input.response_g, -w_g, w_g);
  }
};

}  // namespace

const Effect& sensor_dead_zone() {
  static const DeadZone instance;
  return instance;
}

}  // namespace plumbline
