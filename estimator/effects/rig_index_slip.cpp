#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// The index of the spindle slips once: δ += ε from one pose on.
class IndexSlip final : public Effect {
 public:
  std::string id() const override { return "rig.index_slip"; }
  Subject subject() const override { return Subject::head; }
  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"epsilon", "deg", ParameterRole::amplitude}, {"pose", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // One pose at the end, or at the beginning, that is off is rig.pose_outlier.
    constexpr std::size_t kFewest = 2;
    std::vector<Hypothesis> starts;
    for (std::size_t k = kFewest; k + kFewest <= log.visits.size(); ++k) {
      starts.push_back({{effect::kSmallAngle_deg, static_cast<double>(k)}});
    }
    return starts;
  }
  void displace(const VisitLog&, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    if (static_cast<double>(visit) >= p[1]) head.delta_rad += p[0] * kRadPerDeg;
  }
  std::optional<std::size_t> sets_in_at(const VisitLog&,
                                        const std::vector<double>& p) const override {
    return static_cast<std::size_t>(p[1]);
  }
  bool carries_over() const override { return false; }
};

}  // namespace

const Effect& rig_index_slip() {
  static const IndexSlip instance;
  return instance;
}

}  // namespace plumbline
