#include <cmath>
#include <utility>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Periodic error of the spindle drive: δ += c·cos nδ + s·sin nδ, 3 ≤ n ≤ 17. On a grid n stands for
// all orders that look like it there: on one of 24 steps 10 for 14.
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
    std::vector<double> delta_rad;
    for (const Visit& visit : log.visits) delta_rad.push_back(visit.delta_rad);
    const int positions = effect::positions_of_a_turn(std::move(delta_rad));
    std::vector<Hypothesis> starts;
    for (int n = 3; n <= 17 && 2 * n <= positions; ++n)
      starts.push_back(
          effect::harmonic(n, positions, log.visits.front().delta_rad, effect::kSmallAngle_deg));
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const double phase = p[0] * log.visits[visit].delta_rad;
    head.delta_rad += (p[1] * std::cos(phase) + p[2] * std::sin(phase)) * kRadPerDeg;
  }
};

}  // namespace

const Effect& rig_delta_periodic() {
  static const DeltaPeriodic instance;
  return instance;
}

}  // namespace plumbline
