#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

/// Whether the visits show nothing of the order that a lower one does not do as well: on a grid of
/// 24 steps 14 is 10.
bool is_alias_of_lower(const VisitLog& log, int n) {
  constexpr double kSame_rad = 0.02;
  const auto is_whole_turns = [&](int times) {
    return std::all_of(log.visits.begin(), log.visits.end(), [times](const Visit& visit) {
      return std::abs(std::remainder(times * visit.delta_rad, 2 * std::numbers::pi)) < kSame_rad;
    });
  };
  for (int lower = 0; lower < n; ++lower)
    if (is_whole_turns(n - lower) || is_whole_turns(n + lower)) return true;
  return false;
}

// Periodic error of the spindle drive: δ += c·cos nδ + s·sin nδ, 3 ≤ n ≤ 17. On a grid n stands for
// all orders that look like it there.
class DeltaPeriodic final : public Effect {
 public:
  std::string id() const override { return "rig.delta_periodic"; }
  Subject subject() const override { return Subject::head; }
  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"n", "", ParameterRole::index},
            {"c", "deg", ParameterRole::amplitude},
            {"s", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    std::vector<Hypothesis> starts;
    for (int n = 3; n <= 17; ++n)
      if (!is_alias_of_lower(log, n))
        starts.push_back(
            {{static_cast<double>(n), effect::kSmallAngle_deg, effect::kSmallAngle_deg}});
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const double phase = p[0] * log.visits[visit].delta_rad;
    head.delta_rad += (p[1] * std::cos(phase) + p[2] * std::sin(phase)) * effect::kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_delta_periodic() {
  static const DeltaPeriodic instance;
  return instance;
}

}  // namespace plumbline
