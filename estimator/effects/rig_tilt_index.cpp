#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Zero of the tilt, or base tilted about y_b: h = h_commanded + ε.
class TiltIndex final : public Effect {
 public:
  std::string id() const override { return "rig.tilt_index"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"epsilon", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{effect::kSmallAngle_deg}}};
  }
  void displace(const VisitLog&, std::size_t, const double* p, HeadGeometry& head) const override {
    head.h_rad += p[0] * kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_tilt_index() {
  static const TiltIndex instance;
  return instance;
}

}  // namespace plumbline
