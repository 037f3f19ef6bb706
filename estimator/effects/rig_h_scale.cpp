#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Scale of the tilt: h = h_commanded·(1 + k).
class TiltScale final : public Effect {
 public:
  std::string id() const override { return "rig.h_scale"; }
  Subject subject() const override { return Subject::head; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"k", "", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{{5e-4}}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.h_rad += p[0] * log.visits[visit].h_rad;
  }
};

}  // namespace

const Effect& rig_h_scale() {
  static const TiltScale instance;
  return instance;
}

}  // namespace plumbline
