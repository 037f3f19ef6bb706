// What has the sign of the direction in which something went last, and fades.
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "estimator/effects/driven_term.h"

namespace plumbline {
namespace {

/// Proportional to the direction, and to what is left of it.
class Fading : public DrivenTerm {
 public:
  Fading(DriverPointer direction, DriverPointer clock, Target target)
      : DrivenTerm(std::move(direction), target), clock_(std::move(clock)) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"tau", "s", ParameterRole::shape}, {"p", target().unit(), ParameterRole::amplitude}};
  }

 protected:
  const std::vector<double>& time_s() const { return clock_->value[0]; }
  double span_s() const { return time_s().back() - time_s().front(); }
  std::vector<Hypothesis> starts_from(const std::vector<double>& taus_s) const {
    std::vector<Hypothesis> starts;
    if (!variable().varies()) return starts;
    for (const double tau_s : taus_s) starts.push_back({{tau_s, target().typical_size()}});
    return starts;
  }

 private:
  /// That which fades, at a visit.
  virtual double age_s(std::size_t axis, std::size_t visit) const = 0;
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    if (!(p[0] > 0)) return 0;
    return variable().value[axis][visit] * p[1] * std::exp(-age_s(axis, visit) / p[0]);
  }

  DriverPointer clock_;
};

class FadingDirection final : public Fading {
 public:
  using Fading::Fading;
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kTimeConstants = 4;
    return starts_from(effect::geometric(span_s() / 20, span_s() / 2, kTimeConstants));
  }

 private:
  std::string function() const override { return "exponential of the time"; }
  double age_s(std::size_t, std::size_t visit) const override { return time_s()[visit]; }
};

class FadingReversal final : public Fading {
 public:
  FadingReversal(DriverPointer direction, DriverPointer clock, Target target)
      : Fading(std::move(direction), std::move(clock), target) {
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const std::vector<double>& side = variable().value[axis];
      double reversed_s = -std::numeric_limits<double>::infinity();  // nobody saw it
      for (std::size_t k = 0; k < side.size(); ++k) {
        if (k > 0 && side[k] != side[k - 1]) reversed_s = time_s()[k];
        age_s_[axis].push_back(time_s()[k] - reversed_s);
      }
    }
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kTimeConstants = 4;
    const double spacing_s = span_s() / static_cast<double>(time_s().size());
    return starts_from(effect::geometric(0.7 * spacing_s, 20 * spacing_s, kTimeConstants));
  }

 private:
  std::string function() const override { return "fading after a reversal"; }
  double age_s(std::size_t axis, std::size_t visit) const override { return age_s_[axis][visit]; }

  PerAxis<std::vector<double>> age_s_;
};

}  // namespace

std::unique_ptr<SmoothTerm> fading_reversal(DriverPointer direction, DriverPointer clock,
                                            const Target& target) {
  return std::make_unique<FadingReversal>(std::move(direction), std::move(clock), target);
}
std::unique_ptr<SmoothTerm> fading_direction(DriverPointer direction, DriverPointer clock,
                                             const Target& target) {
  return std::make_unique<FadingDirection>(std::move(direction), std::move(clock), target);
}

}  // namespace plumbline
