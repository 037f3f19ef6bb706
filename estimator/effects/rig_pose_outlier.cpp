#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// One pose at a wrong angle.
class PoseOutlier final : public Effect {
 public:
  std::string id() const override { return "rig.pose_outlier"; }
  Subject subject() const override { return Subject::head; }
  bool repeats() const override { return true; }
  bool concerns_one_visit() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"poses", "", ParameterRole::index},
            {"delta", "deg", ParameterRole::amplitude},
            {"h", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    std::vector<Hypothesis> starts;
    for (std::size_t k = 0; k < log.visits.size(); ++k) {
      starts.push_back(
          {{static_cast<double>(k), effect::kSmallAngle_deg, effect::kSmallAngle_deg}});
    }
    return starts;
  }
  void displace(const VisitLog&, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    if (static_cast<double>(visit) != p[0]) return;
    head.delta_rad += p[1] * kRadPerDeg;
    head.h_rad += p[2] * kRadPerDeg;
  }
  bool carries_over() const override { return false; }
};

}  // namespace

const Effect& rig_pose_outlier() {
  static const PoseOutlier instance;
  return instance;
}

}  // namespace plumbline
