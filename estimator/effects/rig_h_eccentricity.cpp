#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Eccentric circle of the tilt: h += c·cos h + s·sin h.
class TiltEccentricity final : public Effect {
 public:
  std::string id() const override { return "rig.h_eccentricity"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"c", "deg", ParameterRole::amplitude}, {"s", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallAngle_deg, effect::kSmallAngle_deg}}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const double h = log.visits[visit].h_rad;
    head.h_rad += (p[0] * std::cos(h) + p[1] * std::sin(h)) * kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_h_eccentricity() {
  static const TiltEccentricity instance;
  return instance;
}

}  // namespace plumbline
