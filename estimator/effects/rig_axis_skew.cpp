#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Spindle not perpendicular to the tilt axis, angle η.
class AxisSkew final : public Effect {
 public:
  std::string id() const override { return "rig.axis_skew"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"eta", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallAngle_deg}}};
  }
  void displace(const VisitLog&, std::size_t, const double* p, HeadGeometry& head) const override {
    head.skew_rad += p[0] * kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_axis_skew() {
  static const AxisSkew instance;
  return instance;
}

}  // namespace plumbline
