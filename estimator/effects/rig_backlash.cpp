#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Where the head stood before the first visit, which nothing recorded says.
enum Start { kUnknown, kFromZero, kLikeTheFirstTurn, kStarts };

// Backlash of the spindle: δ += ±w/2 by the direction in which δ was approached.
class Backlash final : public Effect {
 public:
  std::string id() const override { return "rig.backlash"; }
  Subject subject() const override { return Subject::head; }
  bool remembers() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    // way 0: the head goes the shorter way round; 1: it never passes 360°. start: how it came to
    // its first angle: 0 with no play, 1 from δ = 0, 2 as in the first turn. Nothing recorded says
    // so, but of a rig that ran the plan itself the way is known.
    return {{"w", "deg", ParameterRole::amplitude},
            {"way", "", ParameterRole::index},
            {"start", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // Approached from one side only, backlash is a zero of the spindle.
    std::vector<Hypothesis> starts;
    const std::size_t first_way = log.goes_as_commanded ? 1 : 0;
    for (std::size_t way = first_way; way < 2; ++way) {
      bool forward = false, backward = false, new_way = way == first_way;
      for (const Visit& visit : log.visits) {
        forward |= visit.delta_direction[way] > 0;
        backward |= visit.delta_direction[way] < 0;
        new_way |= visit.delta_direction[1] != visit.delta_direction[0];
      }
      if (!forward || !backward || !new_way) continue;
      std::vector<int> seen;  // starts that lead to the same direction are one
      for (int start = 0; start < kStarts; ++start) {
        const int direction = start_direction(log, 0, way, start);
        if (std::find(seen.begin(), seen.end(), direction) != seen.end()) continue;
        seen.push_back(direction);
        starts.push_back(
            {{effect::kSmallAngle_deg, static_cast<double>(way), static_cast<double>(start)}});
      }
    }
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const std::size_t way = p[1] > 0.5 ? 1 : 0;
    int direction = log.visits[visit].delta_direction[way];
    if (direction == 0)
      direction = start_direction(log, visit, way, static_cast<int>(std::lround(p[2])));
    head.delta_rad += 0.5 * p[0] * direction * effect::kRadPerDeg;
  }
  std::vector<std::vector<double>> left_open_by(const RunHistory& run,
                                                const std::vector<double>& p) const override {
    const VisitLog log = log_of(run);
    const bool one_way = std::all_of(log.visits.begin(), log.visits.end(), [](const Visit& visit) {
      return visit.delta_direction[0] == visit.delta_direction[1];
    });
    std::vector<std::vector<double>> open;
    for (int way = 0; way < 2; ++way) {
      for (int start = 0; start < kStarts; ++start) {
        const std::vector<double> other = {p[0], static_cast<double>(way),
                                           static_cast<double>(start)};
        if (other != p && (one_way || other[1] == p[1])) open.push_back(other);
      }
    }
    return open;
  }

 private:
  static int start_direction(const VisitLog& log, std::size_t visit, std::size_t way, int start) {
    if (start == kFromZero) {
      const double from_zero = log.visits[visit].delta_rad;
      const double turn = way == 0 ? std::remainder(from_zero, 2 * std::numbers::pi) : from_zero;
      return turn > 0 ? 1 : (turn < 0 ? -1 : 0);
    }
    if (start == kLikeTheFirstTurn) {
      for (const Visit& later : log.visits)
        if (later.delta_direction[way] != 0) return later.delta_direction[way];
    }
    return 0;
  }
};

}  // namespace

const Effect& rig_backlash() {
  static const Backlash instance;
  return instance;
}

}  // namespace plumbline
