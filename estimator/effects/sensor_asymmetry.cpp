#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Scale factor asymmetry: ka·|a_i|.
class Asymmetry final : public Effect {
 public:
  std::string id() const override { return "sensor.asymmetry"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"ka", "g/g", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    // Where the axis never sees both signs, |a_i| is a_i itself.
    bool negative = false, positive = false;
    for (const Visit& visit : log.visits) {
      const double a = specific_force_g({visit.delta_rad, visit.h_rad},
                                        log.gamma)(static_cast<Eigen::Index>(axis));
      negative |= a < -1e-6;
      positive |= a > 1e-6;
    }
    if (!negative || !positive) return {};
    return {{{effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * std::abs(input.a());
  }
};

}  // namespace

const Effect& sensor_asymmetry() {
  static const Asymmetry instance;
  return instance;
}

}  // namespace plumbline
