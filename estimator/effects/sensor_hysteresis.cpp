#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Standing at the same angle again, a head is off by some 10″: whether so little rises, nobody
// knows.
constexpr double kSameForce_g = 1e-4;

// Hysteresis: ±w/2, + when a_i rose on the way to this pose, − when it fell.
class Hysteresis final : public Effect {
 public:
  std::string id() const override { return "sensor.hysteresis"; }
  Subject subject() const override { return Subject::sensor; }
  bool remembers() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"w", "g", ParameterRole::amplitude},
            {.name = "start", .unit = "", .role = ParameterRole::index, .unrecorded = true},
            {.name = "ties", .unit = "", .role = ParameterRole::index, .unrecorded = true}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<Hypothesis> found;
    const std::vector<double> changes = commanded_changes(log, axis);
    const auto count = [&](double change) {
      return std::count(changes.begin(), changes.end(), change);
    };
    const bool both_ways = std::min(count(1), count(-1)) >= kFewest;
    // What never falls is left with the same from the first rise on, which may come late.
    const auto first_change =
        std::find_if(changes.begin(), changes.end(), [](double change) { return change != 0; });
    const bool comes_late =
        std::min(first_change - changes.begin(), changes.end() - first_change) >= kFewest;
    for (const Ties ties : {kNothing, kAsBefore}) {
      if (ties == kAsBefore && (count(0) == 0 || !(both_ways || comes_late))) continue;
      if (ties == kNothing &&
          std::ssize(changes) - std::max({count(-1), count(0), count(1)}) < kFewest)
        continue;
      for (const Start start : {kUnknown, kFromZero})
        found.push_back(
            {{effect::kSmallTerm, static_cast<double>(start), static_cast<double>(ties)}});
    }
    return found;
  }
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t axis,
                                 const Hypothesis& found) const override {
    const double so_far = commanded_change(log, 0, axis, found.p.data());
    std::vector<Hypothesis> starts;
    for (const Start start : {kRising, kFalling}) {
      const std::vector<double> p = {found.p[0], static_cast<double>(start), found.p[2]};
      if (commanded_change(log, 0, axis, p.data()) != so_far) starts.push_back({p});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const auto ties = static_cast<Ties>(std::lround(p[2]));
    if (ties == kAsBefore) {
      double left = 0;
      for (std::size_t k = input.visit + 1; k-- > 0 && left == 0;)
        left = commanded_change(input.log, k, input.axis, p);
      return 0.5 * left * p[0];
    }
    const double change = true_change(input, p);
    if (ties == kNothing) return 0.5 * change * p[0];
    const bool is_open =
        change == 0 || change != commanded_change(input.log, input.visit, input.axis, p);
    if (!is_open) return 0.5 * change * p[0];
    return ties == kOpen ? 0 : 0.5 * (ties == kRose ? p[0] : -p[0]);
  }
  std::vector<double> with_ties_open(const VisitLog& log, std::size_t axis,
                                     const std::vector<double>& p) const override {
    constexpr std::ptrdiff_t kOneIn = 5;  // with more the size of the effect is that of noise
    const std::vector<double> changes = commanded_changes(log, axis);
    const auto ties = std::count(changes.begin(), changes.end(), 0.0);
    if (std::lround(p[2]) > kAsBefore || ties * kOneIn > std::ssize(changes)) return {};
    return {p[0], p[1], kOpen};
  }
  std::vector<std::vector<double>> ways_at_ties(const std::vector<double>& p) const override {
    if (std::lround(p[2]) < kOpen) return {};
    return {{p[0], p[1], kRose}, {p[0], p[1], kFell}};
  }

 private:
  /// How the head came to its first pose, which nothing recorded says.
  enum Start { kUnknown, kFromZero, kRising, kFalling };
  /// What is left where the force came back to what it was: nothing, or what was left before, which
  /// is by commanded angles, since true ones never come back. Symmetry brings it back often: two
  /// poses in a row at one h for z, cos 10° cos 20° = cos 20° cos 10° for x.
  enum Ties { kNothing, kAsBefore, kOpen, kRose, kFell };
  /// Visits at which something else is left than at most others: fewer may have any fault.
  static constexpr std::ptrdiff_t kFewest = 5;

  /// What the force did on the way: 1 it rose, −1 it fell, 0 neither, or nobody knows.
  static double sign_of(double rise_g) {
    return std::abs(rise_g) < kSameForce_g ? 0 : (rise_g > 0 ? 1 : -1);
  }
  static double commanded_g(const VisitLog& log, std::size_t visit, std::size_t axis) {
    const Visit& at = log.visits[visit];
    return specific_force_g({.delta_rad = at.delta_rad, .h_rad = at.h_rad},
                            log.gamma)(static_cast<Eigen::Index>(axis));
  }
  /// With how the head came to the first visit.
  static double at_the_start(const VisitLog& log, double first_g, std::size_t axis,
                             const double* p) {
    const auto start = std::lround(p[1]);
    if (start == kUnknown) return 0;
    if (start != kFromZero) return start == kRising ? 1 : -1;
    return sign_of(first_g - specific_force_g({}, log.gamma)(static_cast<Eigen::Index>(axis)));
  }
  static double commanded_change(const VisitLog& log, std::size_t visit, std::size_t axis,
                                 const double* p) {
    const double now_g = commanded_g(log, visit, axis);
    return log.before(visit) != nullptr ? sign_of(now_g - commanded_g(log, visit - 1, axis))
                                        : at_the_start(log, now_g, axis, p);
  }
  static double true_change(const TermInput& input, const double* p) {
    const auto i = static_cast<Eigen::Index>(input.axis);
    const double now_g = input.a_g[input.visit](i);
    return input.log.before(input.visit) != nullptr ? sign_of(now_g - input.a_g[input.visit - 1](i))
                                                    : at_the_start(input.log, now_g, input.axis, p);
  }
  /// By the commanded angles, for every visit but the first.
  static std::vector<double> commanded_changes(const VisitLog& log, std::size_t axis) {
    const double from_unknown[] = {0, kUnknown};
    std::vector<double> changes;
    for (std::size_t k = 1; k < log.visits.size(); ++k)
      changes.push_back(commanded_change(log, k, axis, from_unknown));
    return changes;
  }
};

}  // namespace

const Effect& sensor_hysteresis() {
  static const Hysteresis instance;
  return instance;
}

}  // namespace plumbline
