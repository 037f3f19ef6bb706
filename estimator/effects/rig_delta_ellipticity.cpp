#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Two-lobed circle of the spindle: δ += c·cos 2δ + s·sin 2δ.
class DeltaEllipticity final : public Effect {
 public:
  std::string id() const override { return "rig.delta_ellipticity"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"c", "deg", ParameterRole::amplitude}, {"s", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallAngle_deg, effect::kSmallAngle_deg}}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const double phase = 2 * log.visits[visit].delta_rad;
    head.delta_rad += (p[0] * std::cos(phase) + p[1] * std::sin(phase)) * kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_delta_ellipticity() {
  static const DeltaEllipticity instance;
  return instance;
}

}  // namespace plumbline
