// Functions of a driver that jump again and again, or there and back.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/effects/driven_term.h"

namespace plumbline {
namespace {

class Pulses final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine = 0.1;  // of an edge, so that some readings are in it
    const double fine = kFine * edge();
    ParameterInfo edge_info = effect::instant("edge");
    edge_info.unit = variable().unit();
    return {std::move(edge_info),
            {"period", variable().unit(), ParameterRole::shape, fine},
            {"width", variable().unit(), ParameterRole::shape, fine},
            {"middle", variable().unit(), ParameterRole::shape, fine, true},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    constexpr int kMiddles = 4, kMostPulses = 8;
    std::vector<Hypothesis> starts;
    if (is_of_another_axis(axis)) return starts;
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
    found.reserve(kWidths.size());
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
    return {effect::instant("from"),
            effect::instant("to"),
            {"edge", "s", ParameterRole::index},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  /// Few where two steps that cancel, or a train, lead to all others.
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const double low = range().first, high = range().second;
    std::vector<Hypothesis> starts;
    const auto add_all = [&](double width, double spacing) {
      for (double from = low; from + width < high; from += spacing)
        starts.push_back(half_way(from, from + width, 0, target().typical_size()));
    };
    const double span = high - low;
    if (target().form == TermForm::bias)
      add_all(0.15 * span, 0.075 * span);
    else
      for (const double share : {0.08, 0.15, 0.27, 0.45})
        add_all(share * span, 0.25 * share * span);
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    const double spacing = 4 * part_of_spacing();
    std::vector<Hypothesis> others;
    const auto add_moved = [&](double from, double to) {
      if (from > range().first && to < range().second && from < to)
        others.push_back(half_way(from, to, found.p[2], found.p[3]));
    };
    for (const int visits : {1, 2, 4, 8, 16, 32, 64})
      for (const double move : {-spacing * visits, spacing * visits}) {
        add_moved(found.p[0] + move, found.p[1]);
        add_moved(found.p[0], found.p[1] + move);
        add_moved(found.p[0] + move, found.p[1] + move);
      }
    // An edge within the dwell before or after it.
    for (const double from_s : within_dwells_near(found.p[0]))
      others.push_back({{from_s, found.p[1], 0, found.p[3]}});
    for (const double to_s : within_dwells_near(found.p[1]))
      others.push_back({{found.p[0], to_s, 0, found.p[3]}});
    // Or none that is sharp.
    for (const double visits : {0.5, 1.0, 2.0, 4.0})
      others.push_back({{found.p[0], found.p[1], visits * spacing, found.p[3]}});
    return others;
  }
  /// A step and one back, or a train of which the run saw one pulse.
  std::vector<Hypothesis> in_one(const VisitLog& log, std::size_t axis, const Effect& repeated,
                                 const std::vector<std::vector<double>>& found) const override {
    if (dynamic_cast<const Pulses*>(&repeated) != nullptr && repeated.id() == id()) {
      const std::vector<double>& train = found.front();
      const double from_s = train[3] - 0.5 * train[2], to_s = train[3] + 0.5 * train[2];
      return at_edges_near(from_s, to_s, train[4]);
    }
    if (found.size() != 2) return DrivenTerm::in_one(log, axis, repeated, found);
    const auto there_and_back = [&](std::size_t time, std::size_t size) -> std::vector<Hypothesis> {
      const bool in_order = found[0][time] < found[1][time];
      const auto &first = found[in_order ? 0 : 1], &second = found[in_order ? 1 : 0];
      if (!(first[size] * second[size] < 0)) return {};
      return at_edges_near(first[time], second[time], first[size]);
    };
    if (repeated.id() == "sensor.bias_step" && target().form == TermForm::bias)
      return there_and_back(1, 0);
    const auto* steps = dynamic_cast<const SmoothTerm*>(&repeated);
    if (steps != nullptr && steps->is(driver(), to_string(form()), "step" + target().words()))
      return there_and_back(0, 2);
    return {};
  }

 private:
  std::string function() const override { return "window"; }
  /// Of a dwell in which an edge lies it is there for a part.
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    if (p[2] > 0) {
      const double middle_s = variable().value[axis][visit];
      const double begun = 1 / (1 + std::exp((p[0] - middle_s) / p[2]));
      const double ended = 1 / (1 + std::exp((p[1] - middle_s) / p[2]));
      return p[3] * (begun - ended);
    }
    return p[3] * share_between(axis, visit, p[0], p[1]);
  }
  std::vector<double> within_dwells_near(double t_s) const {
    const std::vector<double>& middles_s = variable().value[0];
    const auto after = static_cast<std::size_t>(
        std::lower_bound(middles_s.begin(), middles_s.end(), t_s) - middles_s.begin());
    std::vector<double> places;
    for (std::size_t visit = std::max<std::size_t>(after, 1) - 1;
         visit < std::min(after + 1, middles_s.size()); ++visit)
      for (const double share : {-0.36, -0.12, 0.12, 0.36})
        places.push_back(middles_s[visit] + share * variable().dwell_s[visit]);
    return places;
  }
  /// Edges half way between the visits that these times lie between.
  Hypothesis half_way(double from, double to, double edge_s, double size) const {
    return {{half_way_between_visits(from), half_way_between_visits(to), edge_s, size}};
  }
  /// The same, and those within the dwells.
  std::vector<Hypothesis> at_edges_near(double from, double to, double size) const {
    std::vector<double> froms_s = within_dwells_near(from), tos_s = within_dwells_near(to);
    froms_s.push_back(half_way_between_visits(from));
    tos_s.push_back(half_way_between_visits(to));
    std::vector<Hypothesis> found;
    for (const double from_s : froms_s)
      for (const double to_s : tos_s) found.push_back({{from_s, to_s, 0, size}});
    return found;
  }
};

/// A shock: there at once, then it dies away.
class Relaxation final : public DrivenTerm {
 public:
  Relaxation(DriverPointer clock, const Target& target, double longest_s)
      : DrivenTerm(std::move(clock), target), longest_s_(longest_s) {}

  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {effect::instant("from"),
            {"tau", "s", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kPlaces = 36;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (int k = 1; k < kPlaces; ++k) add_from(low + (high - low) * k / kPlaces, starts);
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    constexpr int kPlaces = 16;
    std::vector<Hypothesis> others;
    for (int from = -kPlaces; from <= kPlaces; ++from) {
      const double moved = half_way_between_visits(found.p[0] + 4 * part_of_spacing() * from);
      if (moved > range().first) others.push_back({{moved, found.p[1], found.p[2]}});
    }
    return others;
  }
  /// What comes and goes again was taken for steps.
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& steps) const override {
    std::vector<Hypothesis> found;
    if (repeated.id() != "sensor.bias_step" || target().form != TermForm::bias) return found;
    for (const auto& step : steps) add_from(step[1], found);
    return found;
  }

 private:
  std::string function() const override { return "jump that dies away"; }
  double at(double t_s, const double* p) const override {
    return t_s > p[0] && p[1] <= longest_s_ ? p[2] * std::exp((p[0] - t_s) / p[1]) : 0;
  }
  void add_from(double from_s, std::vector<Hypothesis>& starts) const {
    const double span_s = range().second - range().first;
    for (const double tau_s : effect::geometric(span_s / 40, span_s / 4, 4))
      starts.push_back({{half_way_between_visits(from_s), tau_s, target().typical_size()}});
  }

  double longest_s_;
};

class SawTooth final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    const double fine = kFine * edge();
    return {{"edge", "", ParameterRole::index},
            {"period", variable().unit(), ParameterRole::shape, fine},
            {"at", variable().unit(), ParameterRole::shape, fine, true},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    constexpr int kMostTeeth = 12;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    if (is_of_another_axis(axis)) return starts;
    for (int halves = 4; halves <= 2 * kMostTeeth && resolves(2 * halves); ++halves)
      add(2 * (high - low) / halves, starts);
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
    const bool of_codes = repeated.id() == "adc.code_step" && variable().output_of;
    const bool of_time = repeated.id() == "sensor.bias_step" && variable().is_clock();
    if (of_codes || (of_time && target().form == TermForm::bias)) from_falls(instances, found);
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
    // A fall between two visits, of which neither sees the edge.
    for (int at = -kPlaces; variable().is_clock() && at <= kPlaces; ++at)
      others.push_back({{kSharp * found.p[0], found.p[1], found.p[2] + 0.5 * part_of_spacing() * at,
                         found.p[3]}});
    return others;
  }

 private:
  std::string function() const override { return "saw tooth"; }
  double at(double value, const double* p) const override {
    const double cycles = (value - p[2]) / p[1], edge = std::round(cycles);
    const double fallen = 1 - effect::share_below(edge * p[1] + p[2], value, p[0]);
    return p[3] * (cycles - (edge - 1 + fallen) - 0.5);
  }
  static constexpr double kFine = 0.1, kSharp = 0.3;  // of an edge
  /// Noise of single readings reaches over a fall; between two visits it could not be moved.
  double edge() const { return variable().scatter > 0 ? variable().scatter : part_of_spacing(); }
  /// Falls that were found one by one.
  void from_falls(const std::vector<std::vector<double>>& falls,
                  std::vector<Hypothesis>& found) const {
    std::vector<double> places;
    places.reserve(falls.size());
    for (const auto& fall : falls) places.push_back(fall[1]);
    std::sort(places.begin(), places.end());
    for (std::size_t k = 1; k < places.size(); ++k)
      found.push_back({{edge(), places[k] - places[k - 1], places[k], target().typical_size()}});
    if (places.size() < 3) return;
    // The straight line through all of them; some teeth may be missing.
    double shortest = places.back() - places.front();
    for (std::size_t k = 1; k < places.size(); ++k)
      shortest = std::min(shortest, places[k] - places[k - 1]);
    const auto count = static_cast<Eigen::Index>(places.size());
    const Eigen::Map<const Eigen::ArrayXd> at(places.data(), count);
    const Eigen::ArrayXd tooth = ((at - at(0)) / shortest).round();
    const Eigen::ArrayXd off = tooth - tooth.mean();
    const double period = (off * (at - at.mean())).sum() / off.square().sum();
    // A step in time is told from the visit that follows it.
    const bool clock = variable().is_clock();
    const double before = clock ? 2 * part_of_spacing() : 0;
    const double start = at.mean() - period * tooth.mean() - before, size = target().typical_size();
    found.push_back({{edge(), period, start, size}});
    if (!clock) return;
    // Where a fall is large, one visit on its wrong side hides that all others are right.
    constexpr int kPlaces = 4;
    const double reach = 2 * part_of_spacing() / kPlaces, last = tooth(count - 1);
    for (int first = -kPlaces; first <= kPlaces; ++first)
      for (int end = -kPlaces; end <= kPlaces; ++end)
        found.push_back({{kSharp * edge(), period + reach * (end - first) / last,
                          start + reach * first, size}});
  }
  void add(double period, std::vector<Hypothesis>& starts) const {
    constexpr int kPlaces = 6;
    for (int k = 0; k < kPlaces; ++k)
      starts.push_back(
          {{edge(), period, range().first + period * k / kPlaces, target().typical_size()}});
  }
};

/// What shows whether a bit of a code is set: its weight is wrong, or it is felt elsewhere.
class BitOfCode final : public DrivenTerm {
 public:
  BitOfCode(DriverPointer code, Target target, std::optional<Adc> adc)
      : DrivenTerm(std::move(code), target), adc_(adc) {}

  /// Another axis does not see the component that stands for the code.
  bool acts_on(std::size_t) const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"low", "V", ParameterRole::index},
            {"size", "V", ParameterRole::index},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<Hypothesis> starts;
    if (!adc_) return starts;
    const auto [low, high] = range();
    for (int bit = 0; bit < adc_->bits; ++bit) {
      const double size_V = std::ldexp(adc_->lsb_V(), bit);
      // It is set and not set again, and noise does not hide which.
      if (size_V > kHidden * variable().scatter && size_V < 0.5 * (high - low))
        starts.push_back({{adc_->min_V - 0.5 * adc_->lsb_V(), size_V, target().typical_size()}});
    }
    return starts;
  }

 private:
  static constexpr double kHidden = 0.7;

  std::string function() const override { return "bit of the code"; }
  double at(double value, const double* p) const override {
    return p[2] * effect::share_with_bit((value - p[0]) / p[1], variable().scatter / p[1], true);
  }

  std::optional<Adc> adc_;
};

}  // namespace

std::unique_ptr<SmoothTerm> window(DriverPointer clock, const Target& target) {
  return std::make_unique<Window>(std::move(clock), target);
}

std::unique_ptr<SmoothTerm> bit_of_code(DriverPointer code, const Target& target,
                                        const std::optional<Adc>& adc) {
  return std::make_unique<BitOfCode>(std::move(code), target, adc);
}

std::unique_ptr<SmoothTerm> relaxation(DriverPointer clock, const Target& target,
                                       double longest_s) {
  return std::make_unique<Relaxation>(std::move(clock), target, longest_s);
}

std::unique_ptr<SmoothTerm> pulses(DriverPointer driver, const Target& target) {
  return std::make_unique<Pulses>(std::move(driver), target);
}

std::unique_ptr<SmoothTerm> saw_tooth(DriverPointer driver, const Target& target) {
  return std::make_unique<SawTooth>(std::move(driver), target);
}

bool is_saw_tooth(const Effect& effect) {
  return dynamic_cast<const SawTooth*>(&effect) != nullptr;
}

}  // namespace plumbline
