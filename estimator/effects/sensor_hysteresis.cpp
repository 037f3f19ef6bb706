#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Standing at the same angle again, a head is off by some 10″: whether so little rises, nobody
// knows.
constexpr double kSameForce_g = 1e-4;

// Hysteresis: ±w/2, + when a_i rose on the way to this pose, − when it fell.
class Hysteresis final : public Effect {
 public:
  std::string id() const override { return "sensor.hysteresis"; }
  Subject subject() const override { return Subject::sensor; }
  bool remembers() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    // start: how the head came to its first pose, which nothing recorded says: 0 without a trace,
    // 1 from δ = h = 0.
    return {{"w", "g", ParameterRole::amplitude}, {"start", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallTerm, 0}}, {{effect::kSmallTerm, 1}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    const bool unknown = input.log.before(input.visit) == nullptr;
    const bool from_zero = unknown && p[1] > 0.5;
    if (unknown && !from_zero) return 0;
    const auto i = static_cast<Eigen::Index>(input.axis);
    const double before_g =
        from_zero ? Eigen::Vector3d(input.log.gamma, 0, 0)(i) : input.a_g[input.visit - 1](i);
    const double rise = input.a_g[input.visit](i) - before_g;
    if (std::abs(rise) < kSameForce_g) return 0;
    return rise > 0 ? p[0] / 2 : -p[0] / 2;
  }
};

}  // namespace

const Effect& sensor_hysteresis() {
  static const Hysteresis instance;
  return instance;
}

}  // namespace plumbline
