// Functions of a driver at some values of which something happens.
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "estimator/effects/driven_term.h"

namespace plumbline {
namespace {

class Bell final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    const char* unit = variable().angle ? "rad" : "";
    if (is_sparse())
      return {{"middle", unit, ParameterRole::index},
              {"width", unit, ParameterRole::index},
              {"p", target().unit(), ParameterRole::amplitude}};
    return {place("middle"),
            {"width", unit, ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    if (is_sparse()) {
      const std::vector<double> places = values_seen();
      for (std::size_t k = 0; k < places.size(); ++k)
        for (const double share : {0.4, 0.8, 1.6}) {
          const auto add = [&](double middle) {
            starts.push_back({{middle, share * spacing(), target().typical_size()}});
          };
          add(places[k]);
          // One that is seen at two of them at least.
          if (share > 0.5 && k + 1 < places.size()) add(0.5 * (places[k] + places[k + 1]));
        }
      return starts;
    }
    for (const double share : {1.0 / 60, 1.0 / 30, 1.0 / 15}) {
      const double width = share * (high - low);
      const auto steps = static_cast<long>((high - low) / (1.5 * width));
      for (long k = 0; k <= steps; ++k)
        starts.push_back(
            {{low + 1.5 * width * static_cast<double>(k), width, target().typical_size()}});
    }
    return starts;
  }

  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    if (!is_sparse() || found.p[1] < 0.5 * spacing()) return others;
    for (const double away : {-0.4, -0.2, 0.0, 0.2, 0.4})
      for (const double ratio : {0.6, 0.8, 1.0, 1.25, 1.6})
        others.push_back({{found.p[0] + away * spacing(), ratio * found.p[1], found.p[2]}});
    return others;
  }

 private:
  /// Whether a bell may stand between two of its values, where nothing tells its height.
  bool is_sparse() const {
    constexpr int kDense = 12;
    return !resolves(kDense);
  }
  std::vector<double> values_seen() const {
    const std::set<double> values(variable().value[0].begin(), variable().value[0].end());
    return {values.begin(), values.end()};
  }
  double spacing() const {
    const auto [low, high] = range();
    return (high - low) / static_cast<double>(std::max<std::size_t>(1, values_seen().size() - 1));
  }
  std::string function() const override { return "bell"; }
  double at(double value, const double* p) const override {
    const double away = value - p[0];
    const double x = (variable().angle ? std::remainder(away, effect::kTurn_rad) : away) / p[1];
    return p[2] * std::exp(-0.5 * x * x);
  }
};

class Sector final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    const double fine = kFine * kEdge_rad;
    return {{"middle", "rad", ParameterRole::shape, fine, true},
            {"width", "rad", ParameterRole::shape, fine},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double width_rad : {0.7, 1.2, 2.0})
      for (double middle = low; middle < high; middle += 0.35 * width_rad)
        starts.push_back({{middle, width_rad, target().typical_size()}});
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    // Between two positions nothing moves an edge: each is tried at several.
    constexpr int kPlaces = 3;
    constexpr double kApart_rad = 5 * effect::kRadPerDeg;
    std::vector<Hypothesis> others;
    for (int low = -kPlaces; low <= kPlaces; ++low)
      for (int high = -kPlaces; high <= kPlaces; ++high) {
        const double width_rad = found.p[1] + kApart_rad * (high - low);
        if (width_rad > kApart_rad)
          others.push_back({{found.p[0] + 0.5 * kApart_rad * (high + low), width_rad, found.p[2]}});
      }
    return others;
  }

 private:
  static constexpr double kEdge_rad = 1 * effect::kRadPerDeg;
  static constexpr double kFine = 0.1;

  std::string function() const override { return "sector"; }
  double at(double value, const double* p) const override {
    const double from_middle = std::abs(std::remainder(value - p[0], effect::kTurn_rad));
    return p[2] / (1 + std::exp((from_middle - 0.5 * p[1]) / kEdge_rad));
  }
};

class Pulses final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine = 0.1;  // of an edge, so that some readings are in it
    const double fine = kFine * edge();
    return {{"edge", "s", ParameterRole::index},
            {"period", "s", ParameterRole::shape, fine},
            {"width", "s", ParameterRole::shape, fine},
            {"middle", "s", ParameterRole::shape, fine, true},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    constexpr int kMiddles = 4, kMostPulses = 8;
    std::vector<Hypothesis> starts;
    for (int pulses = 2; pulses <= kMostPulses; ++pulses) {
      const double period = (high - low) / pulses;
      for (int k = 0; k < kMiddles; ++k)
        starts.push_back(
            {{edge(), period, 0.5 * period, low + period * k / kMiddles, target().typical_size()}});
    }
    return starts;
  }
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& instances) const override {
    if (target().form != TermForm::bias) return {};
    if (repeated.id() == "sensor.bias_step") return from_steps(instances);
    if (repeated.id() != id()) return {};
    if (is_saw_tooth(repeated)) return from_saw_tooth(instances.front());
    return is_wave(repeated) ? from_waves(instances) : std::vector<Hypothesis>{};
  }

 private:
  std::string function() const override { return "train of pulses"; }
  double at(double value, const double* p) const override {
    const double from_middle = std::abs(std::remainder(value - p[3], p[1]));
    return p[4] / (1 + std::exp((from_middle - 0.5 * p[2]) / p[0]));
  }
  double edge() const { return part_of_spacing(); }
  /// Two steps, a period apart, and one back.
  std::vector<Hypothesis> from_steps(const std::vector<std::vector<double>>& steps) const {
    if (steps.size() != 3) return {};
    const double size = steps[0][0], first_s = steps[0][1];
    const double width_s = steps[2][1] - first_s;
    return {{{edge(), steps[1][1] - first_s, width_s, first_s + 0.5 * width_s, size}}};
  }
  /// The longest of several waves is the fundamental.
  std::vector<Hypothesis> from_waves(const std::vector<std::vector<double>>& waves) const {
    if (waves.size() < 2) return {};  // one alone is a wave
    std::vector<double> longest;
    for (const auto& wave : waves)
      if (longest.empty() || wave[1] > longest[1]) longest = wave;
    const double period = longest[1];
    const double crest =
        longest[0] + period * std::atan2(longest[3], longest[2]) / (2 * std::numbers::pi);
    std::vector<Hypothesis> found;
    for (const double share : kWidths)
      found.push_back({{edge(), period, share * period, crest, target().typical_size()}});
    return found;
  }
  static constexpr std::array kWidths = {0.2, 0.35, 0.5, 0.65, 0.8};  // of a period
  /// Where the one falls the other may begin or end.
  std::vector<Hypothesis> from_saw_tooth(const std::vector<double>& saw) const {
    std::vector<Hypothesis> found;
    const double period = saw[1], fall = saw[2];
    for (const double share : kWidths)
      for (const double side : {-0.5, 0.5})
        found.push_back({{edge(), period, share * period, fall + side * share * period,
                          target().typical_size()}});
    return found;
  }
};

class Window final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    // Between two visits nothing moves a sharp edge.
    return {{"from", "s", ParameterRole::index},
            {"to", "s", ParameterRole::index},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  /// Few: two steps that cancel, or a train, lead to all others.
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    const double width = 0.15 * (high - low);
    std::vector<Hypothesis> starts;
    for (double from = low; from + width < high; from += 0.5 * width)
      starts.push_back(half_way(from, from + width, target().typical_size()));
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    constexpr int kPlaces = 4;
    const double spacing = 4 * part_of_spacing();
    std::vector<Hypothesis> others;
    for (int from = -kPlaces; from <= kPlaces; ++from)
      for (int to = -kPlaces; to <= kPlaces; ++to)
        others.push_back(
            half_way(found.p[0] + spacing * from, found.p[1] + spacing * to, found.p[2]));
    return others;
  }
  /// A step and one back, or a train of which the run saw one pulse.
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& steps) const override {
    if (dynamic_cast<const Pulses*>(&repeated) != nullptr && repeated.id() == id()) {
      const std::vector<double>& train = steps.front();
      return {half_way(train[3] - 0.5 * train[2], train[3] + 0.5 * train[2], train[4])};
    }
    if (repeated.id() != "sensor.bias_step" || steps.size() != 2) return {};
    const bool in_order = steps[0][1] < steps[1][1];
    const std::vector<double>&first = steps[in_order ? 0 : 1], &second = steps[in_order ? 1 : 0];
    if (!(first[0] * second[0] < 0)) return {};
    return {half_way(first[1], second[1], first[0])};
  }

 private:
  std::string function() const override { return "window"; }
  double at(double value, const double* p) const override {
    return value > p[0] && value < p[1] ? p[2] : 0;
  }
  /// Edges half way between the visits that these times lie between.
  Hypothesis half_way(double from, double to, double size) const {
    const auto moved = [this](double time) {
      const std::vector<double>& times = variable().value[0];
      const auto after = std::upper_bound(times.begin(), times.end(), time);
      if (after == times.begin() || after == times.end()) return time;
      return 0.5 * (*(after - 1) + *after);
    };
    return {{moved(from), moved(to), size}};
  }
};

class SawTooth final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    const double fine = kFine * edge();
    return {{"edge", "", ParameterRole::index},
            {"period", "", ParameterRole::shape, fine},
            {"at", "", ParameterRole::shape, fine, true},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    constexpr int kMostTeeth = 12;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    if (is_of_another_axis(axis) || !resolves(4 * kMostTeeth)) return starts;
    for (int halves = 4; halves <= 2 * kMostTeeth; ++halves) add(2 * (high - low) / halves, starts);
    return starts;
  }
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& instances) const override {
    std::vector<Hypothesis> found;
    if (repeated.id() == id() && is_wave(repeated)) {
      double longest = 0;
      for (const auto& wave : instances) longest = std::max(longest, wave[1]);
      for (const double share : {0.97, 1.0, 1.03}) add(share * longest, found);
    }
    const auto* switching = dynamic_cast<const Pulses*>(&repeated);
    if (switching != nullptr && repeated.id() == id())
      for (const double share : {0.97, 1.0, 1.03}) add(share * instances.front()[1], found);
    if (repeated.id() == "adc.code_step" && variable().output_of && instances.size() > 1) {
      std::vector<double> places;
      for (const auto& step : instances) places.push_back(step[1]);
      std::sort(places.begin(), places.end());
      for (std::size_t k = 1; k < places.size(); ++k)
        found.push_back({{edge(), places[k] - places[k - 1], places[k], target().typical_size()}});
    }
    return found;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    constexpr int kPlaces = 4;
    constexpr double kReach = 0.1;  // of a tooth
    const double span = range().second - range().first, teeth = span / found.p[1];
    std::vector<Hypothesis> others;
    for (int period = -kPlaces; period <= kPlaces; ++period)
      for (int at = -kPlaces; at <= kPlaces; ++at)
        others.push_back({{found.p[0], found.p[1] * (1 + kReach * period / (teeth * kPlaces)),
                           found.p[2] + kReach * found.p[1] * at / kPlaces, found.p[3]}});
    return others;
  }

 private:
  std::string function() const override { return "saw tooth"; }
  double at(double value, const double* p) const override {
    const double cycles = (value - p[2]) / p[1], edge = std::round(cycles);
    const double fallen = 1 - effect::share_below(edge * p[1] + p[2], value, p[0]);
    return p[3] * (cycles - (edge - 1 + fallen) - 0.5);
  }
  static constexpr double kFine = 0.1;
  /// Noise of single readings reaches over a fall; between two visits it could not be moved.
  double edge() const { return variable().scatter > 0 ? variable().scatter : part_of_spacing(); }
  void add(double period, std::vector<Hypothesis>& starts) const {
    constexpr int kPlaces = 6;
    for (int k = 0; k < kPlaces; ++k)
      starts.push_back(
          {{edge(), period, range().first + period * k / kPlaces, target().typical_size()}});
  }
};

class Bend final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", "", ParameterRole::index},
            {"high", "", ParameterRole::index},
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
    if (!variable().component) return starts;
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
    return p[4] * std::max(0.0, p[2] * (value - p[3]));
  }
  /// On both sides of zero, beyond the same size.
  static constexpr double kOdd = 0, kEven = 2;
};

class Step final : public DrivenTerm {
 public:
  Step(DriverPointer driver, Target target, StepEdge edge)
      : DrivenTerm(std::move(driver), target), edge_(edge) {}

  std::vector<ParameterInfo> parameters() const override {
    // Hardly a reading lies in the edge of a sharp step: its width is not differentiated.
    const auto width = edge_ == StepEdge::sharp ? ParameterRole::index : ParameterRole::shape;
    return {place("at"), {"width", "", width}, {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    const bool sharp = edge_ == StepEdge::sharp;
    std::vector<double> widths = {0.04 * (high - low), 0.13 * (high - low)};
    int parts = 12;
    // A large one is wrong by much at every visit between it and the place tried.
    if (sharp) {
      const int visits = target().other == 0 ? 2 : 4;
      const bool clock = variable().is_clock();
      widths = {clock ? part_of_spacing() : 0.01 * (high - low)};
      parts = clock ? static_cast<int>(variable().value[0].size()) / visits : 32;
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

 private:
  std::string function() const override { return "step"; }
  double at(double value, const double* p) const override {
    return p[2] / (1 + std::exp((p[0] - value) / p[1]));
  }

  StepEdge edge_;
};

class PlayLag final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  bool remembers() const override { return true; }
  bool guesses_at_start() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"width", "", ParameterRole::shape}, {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double share : effect::geometric(0.01, 0.64, 7))
      if (goes_to_and_fro(axis, share * (high - low)))
        starts.push_back({{share * (high - low), target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "lag behind a play"; }
  /// Drawn along in one direction only, the lag is a function of the driver itself.
  bool goes_to_and_fro(std::size_t axis, double width) const {
    const std::vector<double>& driver = variable().value[axis];
    const double half = 0.5 * width;
    bool up = false, down = false;
    double follower = driver.front();
    for (const double value : driver) {
      up |= value - half > follower;
      down |= value + half < follower;
      follower = std::clamp(follower, value - half, value + half);
    }
    return up && down;
  }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const std::vector<double>& driver = variable().value[axis];
    const double half = 0.5 * std::abs(p[0]);
    double follower = driver.front();
    for (std::size_t k = 0; k <= visit; ++k)
      follower = std::clamp(follower, driver[k] - half, driver[k] + half);
    return p[1] * (follower - driver[visit]);
  }
};

}  // namespace

std::unique_ptr<SmoothTerm> bell(DriverPointer driver, const Target& target) {
  return std::make_unique<Bell>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> sector(DriverPointer angle, const Target& target) {
  return std::make_unique<Sector>(std::move(angle), target);
}
std::unique_ptr<SmoothTerm> saw_tooth(DriverPointer driver, const Target& target) {
  return std::make_unique<SawTooth>(std::move(driver), target);
}
bool is_saw_tooth(const Effect& effect) {
  return dynamic_cast<const SawTooth*>(&effect) != nullptr;
}
std::unique_ptr<SmoothTerm> window(DriverPointer clock, const Target& target) {
  return std::make_unique<Window>(std::move(clock), target);
}

std::unique_ptr<SmoothTerm> pulses(DriverPointer driver, const Target& target) {
  return std::make_unique<Pulses>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> bend(DriverPointer driver, const Target& target) {
  return std::make_unique<Bend>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> step(DriverPointer driver, const Target& target, StepEdge edge) {
  return std::make_unique<Step>(std::move(driver), target, edge);
}
std::unique_ptr<SmoothTerm> play(DriverPointer driver, const Target& target) {
  return std::make_unique<PlayLag>(std::move(driver), target);
}

}  // namespace plumbline
