#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// A field fixed to the base, magnetic say: m1·e1_i + m2·e2_i with e1 = x_b and e2 = y_b seen in the
// sensor frame.
class BaseField final : public Effect {
 public:
  std::string id() const override { return "env.base_field"; }
  Subject subject() const override { return Subject::sensor; }
  bool of_the_room() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"m1", "g", ParameterRole::amplitude}, {"m2", "g", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    // The spindle axis never sees y_b.
    if (axis == 2) return {{{effect::kSmallTerm, 0}}};
    return {{{effect::kSmallTerm, effect::kSmallTerm}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    const HorizontalAxes seen = horizontal_axes(input.at().delta_rad, input.at().h_rad);
    const auto i = static_cast<Eigen::Index>(input.axis);
    return p[0] * seen.x_b(i) + p[1] * seen.y_b(i);
  }
};

}  // namespace

const Effect& env_base_field() {
  static const BaseField instance;
  return instance;
}

}  // namespace plumbline
