#include <cmath>

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
            {"start", "", ParameterRole::index},
            {"ties", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    bool ties = false;
    for (std::size_t k = 1; k < log.visits.size(); ++k)
      ties |= std::abs(commanded_g(log, k, axis) - commanded_g(log, k - 1, axis)) < kSameForce_g;
    std::vector<Hypothesis> found;
    for (const Ties at_ties : {kNothing, kAsBefore})
      for (const Start start : {kUnknown, kFromZero})
        if (ties || at_ties == kNothing)
          found.push_back(
              {{effect::kSmallTerm, static_cast<double>(start), static_cast<double>(at_ties)}});
    return found;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const auto ties = static_cast<Ties>(std::lround(p[2]));
    double sign = change_at(input, input.visit, p);
    if (ties >= kOpen && is_open(input, p))
      return ties == kOpen ? 0 : 0.5 * (ties == kRose ? p[0] : -p[0]);
    for (std::size_t k = input.visit; ties == kAsBefore && sign == 0 && k > 0; --k)
      sign = change_at(input, k - 1, p);
    return 0.5 * sign * p[0];
  }
  std::vector<double> with_ties_open(const VisitLog&, std::size_t,
                                     const std::vector<double>& p) const override {
    if (std::lround(p[2]) > kAsBefore) return {};
    return {p[0], p[1], kOpen};
  }
  std::vector<std::vector<double>> ways_at_ties(const std::vector<double>& p) const override {
    if (std::lround(p[2]) < kOpen) return {};
    return {{p[0], p[1], kRose}, {p[0], p[1], kFell}};
  }

 private:
  /// How the head came to its first pose, which nothing recorded says.
  enum Start { kUnknown, kFromZero };
  /// What is left where the force came back to what it was: nothing, or what was left before.
  /// Symmetry brings it back often: two poses in a row at one h for z, cos 10° cos 20° =
  /// cos 20° cos 10° for x.
  enum Ties { kNothing, kAsBefore, kOpen, kRose, kFell };

  static double commanded_g(const VisitLog& log, std::size_t visit, std::size_t axis) {
    const Visit& at = log.visits[visit];
    return specific_force_g({.delta_rad = at.delta_rad, .h_rad = at.h_rad},
                            log.gamma)(static_cast<Eigen::Index>(axis));
  }
  /// What the force did on the way: 1 it rose, −1 it fell, 0 neither, or nobody knows.
  static double sign_of(double rise_g) {
    return std::abs(rise_g) < kSameForce_g ? 0 : (rise_g > 0 ? 1 : -1);
  }
  static double change_at(const TermInput& input, std::size_t visit, const double* p) {
    const auto i = static_cast<Eigen::Index>(input.axis);
    if (input.log.before(visit) != nullptr)
      return sign_of(input.a_g[visit](i) - input.a_g[visit - 1](i));
    if (p[1] < 0.5) return 0;
    return sign_of(input.a_g[visit](i) - Eigen::Vector3d(input.log.gamma, 0, 0)(i));
  }
  /// Whether the commanded force says otherwise than the true one, or neither says anything.
  static bool is_open(const TermInput& input, const double* p) {
    const double sign = change_at(input, input.visit, p);
    if (sign == 0) return true;
    if (input.log.before(input.visit) == nullptr) return false;
    return sign_of(commanded_g(input.log, input.visit, input.axis) -
                   commanded_g(input.log, input.visit - 1, input.axis)) != sign;
  }
};

}  // namespace

const Effect& sensor_hysteresis() {
  static const Hysteresis instance;
  return instance;
}

}  // namespace plumbline
