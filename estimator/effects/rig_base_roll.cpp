#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Base tilted about x_b by ε.
class BaseRoll final : public Effect {
 public:
  std::string id() const override { return "rig.base_roll"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"epsilon", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallAngle_deg}}};
  }
  void displace(const VisitLog&, std::size_t, const double* p, HeadGeometry& head) const override {
    head.roll_rad += p[0] * kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_base_roll() {
  static const BaseRoll instance;
  return instance;
}

}  // namespace plumbline
