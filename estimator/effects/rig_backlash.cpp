#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Where the head stood before the first visit, which nothing recorded says.
enum Start { kUnknown, kFromZero, kLikeTheFirstTurn, kStarts };
// Which way it turns: places in Visit::delta_direction but for the last.
enum Way { kShorter, kWithinTheTurn, kShorterOtherHalf, kOpenWay };

// Backlash of the spindle: δ += ±w/2 by the direction in which δ was approached.
class Backlash final : public Effect {
 public:
  std::string id() const override { return "rig.backlash"; }
  Subject subject() const override { return Subject::head; }
  bool remembers() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    // way 0: the head goes the shorter way round; 1: it never passes 360°; 2: the shorter way, half
    // turns backwards; 3: the shorter way, whichever it is at half turns. start: how it came to
    // its first angle: 0 with no play, 1 from δ = 0, 2 as in the first turn. Nothing recorded says
    // so, but of a rig that ran the plan itself the way is known.
    return {{"w", "deg", ParameterRole::amplitude},
            {.name = "way", .unit = "", .role = ParameterRole::index, .unrecorded = true},
            {.name = "start", .unit = "", .role = ParameterRole::index, .unrecorded = true}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // Approached from one side only, backlash is a zero of the spindle.
    std::vector<Hypothesis> starts;
    const std::size_t first_way = log.goes_as_commanded ? kWithinTheTurn : kShorter;
    const std::size_t ways = log.goes_as_commanded ? kShorterOtherHalf : kOpenWay;
    for (std::size_t way = first_way; way < ways; ++way) {
      bool forward = false, backward = false;
      for (const Visit& visit : log.visits) {
        forward |= visit.delta_direction[way] > 0;
        backward |= visit.delta_direction[way] < 0;
      }
      bool new_way = true;
      for (std::size_t other = first_way; other < way; ++other)
        new_way &= !same_directions(log, way, other);
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
    const auto way = static_cast<std::size_t>(std::lround(p[1]));
    const auto start = static_cast<int>(std::lround(p[2]));
    const double direction = way < kOpenWay
                                 ? direction_at(log, visit, way, start)
                                 : 0.5 * (direction_at(log, visit, kShorter, start) +
                                          direction_at(log, visit, kShorterOtherHalf, start));
    head.delta_rad += 0.5 * p[0] * direction * kRadPerDeg;
  }
  std::vector<std::vector<double>> left_open_by(const RunHistory& run,
                                                const std::vector<double>& p) const override {
    const VisitLog log = log_of(run);
    const bool one_way = same_directions(log, kShorter, kWithinTheTurn);
    std::vector<std::vector<double>> open;
    const bool halves = !same_directions(log, kShorter, kShorterOtherHalf);
    for (std::size_t way = 0; way <= kOpenWay; ++way) {
      for (int start = 0; start < kStarts; ++start) {
        const std::vector<double> other = {p[0], static_cast<double>(way),
                                           static_cast<double>(start)};
        const bool same_way = other[1] == p[1] || (!halves && way != kWithinTheTurn &&
                                                   std::lround(p[1]) != kWithinTheTurn);
        const bool takes_one = way != kOpenWay || other[1] == p[1];
        if (other != p && takes_one && (one_way || same_way)) open.push_back(other);
      }
    }
    return open;
  }
  std::vector<double> with_ties_open(const VisitLog& log, std::size_t,
                                     const std::vector<double>& p) const override {
    const auto way = static_cast<std::size_t>(std::lround(p[1]));
    if ((way != kShorter && way != kShorterOtherHalf) ||
        same_directions(log, kShorter, kShorterOtherHalf))
      return {};
    return {p[0], kOpenWay, p[2]};
  }
  std::vector<std::vector<double>> ways_at_ties(const std::vector<double>& p) const override {
    if (std::lround(p[1]) != kOpenWay) return {};
    return {{p[0], kShorter, p[2]}, {p[0], kShorterOtherHalf, p[2]}};
  }

 private:
  static bool same_directions(const VisitLog& log, std::size_t way, std::size_t other) {
    return std::all_of(log.visits.begin(), log.visits.end(), [&](const Visit& visit) {
      return visit.delta_direction[way] == visit.delta_direction[other];
    });
  }
  static int direction_at(const VisitLog& log, std::size_t visit, std::size_t way, int start) {
    const int direction = log.visits[visit].delta_direction[way];
    return direction != 0 ? direction : start_direction(log, visit, way, start);
  }
  static int start_direction(const VisitLog& log, std::size_t visit, std::size_t way, int start) {
    if (start == kFromZero) {
      const double from_zero = log.visits[visit].delta_rad;
      const double turn =
          way == kWithinTheTurn ? from_zero : std::remainder(from_zero, 2 * std::numbers::pi);
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
