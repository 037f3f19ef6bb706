#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Backlash of the spindle: δ += ±w/2 by the direction in which δ was approached.
class Backlash final : public Effect {
 public:
  std::string id() const override { return "rig.backlash"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    // way 0: the head goes the shorter way round; 1: it never passes 360°. Nothing recorded says
    // so.
    return {{"w", "deg", ParameterRole::amplitude}, {"way", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // Approached from one side only, backlash is a zero of the spindle.
    std::vector<Hypothesis> starts;
    for (std::size_t way = 0; way < 2; ++way) {
      bool forward = false, backward = false, new_way = way == 0;
      for (const Visit& visit : log.visits) {
        forward |= visit.delta_direction[way] > 0;
        backward |= visit.delta_direction[way] < 0;
        new_way |= visit.delta_direction[1] != visit.delta_direction[0];
      }
      if (forward && backward && new_way)
        starts.push_back({{effect::kSmallAngle_deg, static_cast<double>(way)}});
    }
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.delta_rad +=
        0.5 * p[0] * log.visits[visit].delta_direction[p[1] > 0.5 ? 1 : 0] * effect::kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_backlash() {
  static const Backlash instance;
  return instance;
}

}  // namespace plumbline
