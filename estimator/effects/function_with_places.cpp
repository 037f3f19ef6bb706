// Functions of a driver at some values of which something happens.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "estimator/effects/driven_term.h"
#include "estimator/effects/place.h"

namespace plumbline {
namespace {

class Bend final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {"side", "", ParameterRole::index},
            place("at"),
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    constexpr int kParts = 8;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    if (is_bias_in_disguise(axis)) return starts;
    for (int k = 1; k < kParts; ++k) {
      const double at = low + (high - low) * k / kParts;
      starts.push_back({{low, high, 1, at, target().typical_size()}});
      // The two sides differ by a straight line.
      if (!is_in_the_twelve()) starts.push_back({{low, high, -1, at, target().typical_size()}});
    }
    if (!variable().component && !variable().span) {
      for (int k = 1; k < kParts; ++k)
        starts.push_back(
            {{low, high, kValley, low + (high - low) * k / kParts, target().typical_size()}});
      return starts;
    }
    const double most = std::max(std::abs(low), std::abs(high));
    for (const double side : {kOdd, kEven})
      for (int k = 1; k < kParts; ++k)
        starts.push_back({{low, high, side, most * k / kParts, target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "bend"; }
  double at(double value, const double* p) const override {
    // A bend at the very end is none: it would follow the last readings, whatever they are.
    constexpr double kEnd = 0.08;
    const double end = kEnd * (p[1] - p[0]);
    if (p[3] < p[0] + end || p[3] > p[1] - end) return 0;
    if (p[2] == kOdd || p[2] == kEven) {
      const double beyond = std::max(0.0, std::abs(value) - p[3]);
      return p[4] * (p[2] == kOdd ? std::copysign(beyond, value) : beyond);
    }
    if (p[2] == kValley) return p[4] * std::abs(value - p[3]);
    return p[4] * std::max(0.0, p[2] * (value - p[3]));
  }
  /// On both sides of zero, beyond the same size; to both sides of the bend.
  static constexpr double kOdd = 0, kEven = 2, kValley = 3;
};

class PowerBeyond final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {"side", "", ParameterRole::index},
            place("at"),
            {"power", "", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 6;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double side : {-1.0, 1.0})
      for (int k = 1; k < kParts; ++k)
        for (const double power : {0.6, 1.6})
          starts.push_back(
              {{low, high, side, low + (high - low) * k / kParts, power, target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "power beyond a value"; }
  double at(double value, const double* p) const override {
    const double beyond = p[2] * (value - p[3]) / (p[1] - p[0]);
    return beyond > 0 && p[4] > 0 ? p[5] * std::pow(beyond, p[4]) : 0;
  }
};

/// Nothing moves the edge between two values, so it is searched for.
class GainBeyond final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"side", "", ParameterRole::index},
            {"at", variable().unit(), ParameterRole::index},
            {"p", "g/g", ParameterRole::amplitude},
            {"offset", "g", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    std::vector<Hypothesis> starts;
    if (is_of_another_axis(axis)) return starts;
    constexpr int kParts = 16;
    const auto [low, high] = range();
    const double most = std::max(std::abs(low), std::abs(high));
    const double size = target().typical_size();
    for (int k = 1; k < kParts; ++k) {
      const double of_both = most * k / kParts, above = low + (high - low) * k / kParts;
      for (const double offset : {0.0, size}) {
        starts.push_back({{kBoth, of_both, size, offset}});
        starts.push_back({{kAbove, above, size, offset}});
      }
      // An offset alone, beyond one value, is a step.
      starts.push_back({{kBoth, of_both, 0, size}});
    }
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    constexpr int kPlaces = 10;  // on either side
    constexpr double kApart = 0.006;
    std::vector<Hypothesis> others;
    for (int place = -kPlaces; place <= kPlaces; ++place)
      others.push_back({{found.p[0], found.p[1] + kApart * (range().second - range().first) * place,
                         found.p[2], found.p[3]}});
    return others;
  }
  double choice_uncertainty(const VisitLog&, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    if (k != 1) return 0;
    std::vector<double> values = variable().value[axis];
    for (double& value : values) value = decides(value, p[0]);
    return effect::u_between_neighbours(std::move(values), p[1]);
  }

 private:
  static constexpr double kBoth = 0, kAbove = 1;

  static double decides(double value, double side) {
    return side == kBoth ? std::abs(value) : value;
  }
  std::string function() const override { return "gain beyond a value"; }
  double at(double value, const double* p) const override {
    return decides(value, p[0]) > p[1] ? p[2] * value + p[3] : 0;
  }
};

class Thrown final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine_rad = 0.1 * kRadPerDeg;
    return {{"middle", "rad", ParameterRole::shape, kFine_rad, true},
            {"softness", "", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 10;  // of half a turn: the amplitude has a sign
    std::vector<Hypothesis> starts;
    for (int k = 0; k < kParts; ++k)
      for (const double softness : {0.05, 0.3})
        starts.push_back(
            {{0.5 * effect::kTurn_rad * k / kParts, softness, target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "thrown from side to side"; }
  double at(double value, const double* p) const override {
    return p[2] * std::tanh(std::cos(value - p[0]) / p[1]);
  }
};

/// What presses to one side only.
class HalfWave final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine_rad = 0.1 * kRadPerDeg;
    std::vector<ParameterInfo> infos = {
        {"middle", "rad", ParameterRole::shape, kFine_rad, true},
        {.name = "p", .unit = target().unit(), .role = ParameterRole::amplitude, .needed = true}};
    add_mean(infos);
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 12;
    std::vector<Hypothesis> starts;
    for (int k = 0; k < kParts; ++k)
      add_with_mean({effect::kTurn_rad * k / kParts, target().typical_size()}, starts);
    return starts;
  }

 private:
  std::string function() const override { return "half a wave"; }
  double at(double value, const double* p) const override {
    return mean(p + 2) + p[1] * std::max(0.0, std::cos(value - p[0]));
  }
};

class Step final : public DrivenTerm {
 public:
  Step(DriverPointer driver, Target target, StepEdge edge)
      : DrivenTerm(std::move(driver), target), edge_(edge) {}

  std::vector<ParameterInfo> parameters() const override {
    // Hardly a reading lies in the edge of a sharp step: its width is not differentiated.
    const auto width = edge_ == StepEdge::sharp ? ParameterRole::index : ParameterRole::shape;
    return {place("at"),
            {"width", variable().unit(), width},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    // In the codes of the axis itself it is a listed effect.
    if (variable().output_of == axis || is_bias_in_disguise(axis)) return {};
    const auto [low, high] = range();
    const bool sharp = edge_ == StepEdge::sharp;
    std::vector<double> widths = {0.04 * (high - low), 0.13 * (high - low)};
    int parts = 12;
    // A large one is wrong by much at every visit between it and the place tried.
    if (sharp) {
      const bool has_rivals = target().other != 0 || target().angle == kSeat.angle;
      const int visits = has_rivals ? 4 : 2;
      const bool clock = variable().is_clock();
      widths = {clock ? part_of_spacing() : 0.01 * (high - low)};
      // Of a scale fewer will do: most of what it does is the same for a place near by.
      const int of_range = variable().component && form() == TermForm::scale ? 16 : 32;
      parts = clock ? static_cast<int>(variable().value[0].size()) / visits : of_range;
    }
    std::vector<Hypothesis> starts;
    for (const double width : widths)
      for (int k = 1; k < parts; ++k)
        starts.push_back({{low + (high - low) * k / parts, width, target().typical_size()}});
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    if (edge_ == StepEdge::gradual) return others;
    for (const double ratio : {0.25, 0.35, 0.5, 0.7, 1.4, 2.0, 2.8, 4.0})
      others.push_back({{found.p[0], ratio * found.p[1], found.p[2]}});
    // Between two readings nothing moves a sharp step: it is tried at every place.
    constexpr double kSharp = 0.08;
    constexpr int kPlaces = 8;  // on either side
    for (int place = -kPlaces; place <= kPlaces; ++place)
      others.push_back({{found.p[0] + 0.25 * place * found.p[1], kSharp * found.p[1], found.p[2]}});
    return others;
  }
  /// Of the clock, or of a column that passes the place but once.
  std::optional<std::size_t> sets_in_at(const VisitLog&,
                                        const std::vector<double>& p) const override {
    if (!variable().is_clock() && !variable().recorded) return {};
    const std::vector<double>& value = variable().value[0];
    std::optional<std::size_t> passed;
    for (std::size_t k = 1; k < value.size(); ++k) {
      if ((value[k] > p[0]) == (value[k - 1] > p[0])) continue;
      if (passed) return {};
      passed = k;
    }
    if (!passed || 2 * p[1] > std::abs(value[*passed] - value[*passed - 1])) return {};
    return passed;
  }

  /// A step that nothing moves between two values lies anywhere between them.
  double choice_uncertainty(const VisitLog&, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    return k == 0 ? effect::u_between_neighbours(variable().value[axis], p[0]) : 0;
  }

 private:
  std::string function() const override { return "step"; }
  double at(double value, const double* p) const override {
    return p[2] / (1 + std::exp((p[0] - value) / p[1]));
  }

  StepEdge edge_;
};

}  // namespace

std::unique_ptr<SmoothTerm> bend(DriverPointer driver, const Target& target) {
  return std::make_unique<Bend>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> power_beyond(DriverPointer driver, const Target& target) {
  return std::make_unique<PowerBeyond>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> gain_beyond(DriverPointer component, const Target& target) {
  return std::make_unique<GainBeyond>(std::move(component), target);
}
std::unique_ptr<SmoothTerm> thrown(DriverPointer angle, const Target& target) {
  return std::make_unique<Thrown>(std::move(angle), target);
}
std::unique_ptr<SmoothTerm> half_wave(DriverPointer angle, const Target& target) {
  return std::make_unique<HalfWave>(std::move(angle), target);
}
std::unique_ptr<SmoothTerm> step(DriverPointer driver, const Target& target, StepEdge edge) {
  return std::make_unique<Step>(std::move(driver), target, edge);
}

}  // namespace plumbline
