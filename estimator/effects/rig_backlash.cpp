#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Backlash of the spindle: δ += ±w/2 by the direction in which δ was approached.
class Backlash final : public Effect {
 public:
  std::string id() const override { return "rig.backlash"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"w", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // Approached from one side only, backlash is a zero of the spindle.
    bool forward = false, backward = false;
    for (const Visit& visit : log.visits) {
      forward |= visit.delta_direction > 0;
      backward |= visit.delta_direction < 0;
    }
    if (!forward || !backward) return {};
    return {{{effect::kSmallAngle_deg}}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.delta_rad += 0.5 * p[0] * log.visits[visit].delta_direction * effect::kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_backlash() {
  static const Backlash instance;
  return instance;
}

}  // namespace plumbline
