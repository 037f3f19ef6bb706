#include "estimator/effects/base_tilt.h"

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/wrapped_term.h"

namespace plumbline {
namespace {

/// The last parameter is the direction: 0 tilts as h does, 90° as the base roll does.
class BaseTilt final : public WrappedTerm {
 public:
  explicit BaseTilt(std::unique_ptr<SmoothTerm> of_h)
      : WrappedTerm(std::move(of_h)),
        function_(term().shape().substr(0, term().shape().rfind(kTilt.words()))),
        direction_(term().parameters().size()) {}

  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine_deg = 0.1;
    std::vector<ParameterInfo> infos = term().parameters();
    infos.push_back({.name = "direction",
                     .unit = "deg",
                     .role = ParameterRole::shape,
                     .step = kFine_deg,
                     .place = true,
                     .direction = true});
    return infos;
  }
  /// Along the axes of the base it is a function of h or of the roll.
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<Hypothesis> starts;
    for (const Hypothesis& of_term : term().hypotheses(log, axis))
      for (const double direction_deg : {-45.0, 45.0})
        starts.push_back(towards(of_term, direction_deg));
    return starts;
  }
  std::optional<std::size_t> sets_in_at(const VisitLog& log,
                                        const std::vector<double>& p) const override {
    return term().sets_in_at(log, p);
  }
  double choice_uncertainty(const VisitLog& log, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    return k + 1 < p.size() ? term().choice_uncertainty(log, axis, p, k) : 0;
  }
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t axis,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    for (const Hypothesis& of_term : term().closer(log, axis, found))
      others.push_back(towards(of_term, found.p.back()));
    return others;
  }
  /// What h or the roll seemed to do by itself, a little beside it; what tilts as some other
  /// function says, in the direction of that.
  std::vector<Hypothesis> in_one(const VisitLog& log, std::size_t axis, const Effect& repeated,
                                 const std::vector<std::vector<double>>& p) const override {
    constexpr double kBeside_deg = 20, kRoll_deg = 90;
    std::vector<Hypothesis> found;
    if (p.size() != 1) return found;
    const auto* tilted = dynamic_cast<const BaseTilt*>(&repeated);
    if (tilted != nullptr && tilted != this) {
      if (remembers()) return found;  // a little nearer, but far more than one function
      for (const Hypothesis& of_term : term().hypotheses(log, axis))
        found.push_back(towards(of_term, p.front().back()));
      return found;
    }
    const auto* other = dynamic_cast<const SmoothTerm*>(&repeated);
    if (other == nullptr || other->driver() != driver() ||
        p.front().size() != term().parameters().size())
      return found;
    for (const double axis_deg : {0.0, kRoll_deg})
      if (other->shape() == function_ + (axis_deg == 0 ? kH : kRoll).words())
        for (const double beside_deg : {-kBeside_deg, kBeside_deg})
          found.push_back(towards({p.front()}, axis_deg + beside_deg));
    return found;
  }
  std::vector<double> numbers_of_visits(const VisitLog& log, std::size_t axis,
                                        const double* p) const override {
    return term().numbers_of_visits(log, axis, p);
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    HeadGeometry by;
    term().displace(log, visit, p, by);
    tilt(by, p, head);
  }
  void displace_by_number(const VisitLog& log, std::size_t visit, double number, const double* p,
                          HeadGeometry& head) const override {
    HeadGeometry by;
    term().displace_by_number(log, visit, number, p, by);
    tilt(by, p, head);
  }
  void normalise(std::vector<double>& p) const override {
    const double turned_deg = std::remainder(p.back(), 180);
    if (std::abs(std::remainder(p.back() - turned_deg, 360)) > 90) {
      const auto infos = term().parameters();
      for (std::size_t k = 0; k < infos.size(); ++k)
        if (infos[k].role == ParameterRole::amplitude) p[k] = -p[k];
    }
    p.back() = turned_deg;
  }

 private:
  static Hypothesis towards(const Hypothesis& of_term, double direction_deg) {
    Hypothesis hypothesis = of_term;
    hypothesis.p.push_back(direction_deg);
    return hypothesis;
  }
  void tilt(const HeadGeometry& by, const double* p, HeadGeometry& head) const {
    const double direction_rad = p[direction_] * kRadPerDeg;
    const double cosine = std::cos(direction_rad), sine = std::sin(direction_rad);
    head.h_rad += by.h_rad * cosine;
    head.roll_rad += by.h_rad * sine;
  }

  std::string function_;   ///< without what it acts on
  std::size_t direction_;  ///< among its parameters
};

}  // namespace

std::unique_ptr<SmoothTerm> towards_a_direction(std::unique_ptr<SmoothTerm> term) {
  return std::make_unique<BaseTilt>(std::move(term));
}

}  // namespace plumbline
