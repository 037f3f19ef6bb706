#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/effects/effect.h"
#include "estimator/effects/function_of_driver.h"

namespace plumbline {
namespace {

// Rounding to a step that the description of the run does not declare. How far the noise of a
// reading rounds the stairs off is estimated with it: readings that hardly change say little of it.
//
// A coarser step than the declared one shows in the codes, unless it is little coarser and few
// codes were visited. A finer one does not: what is rounded twice has every code, but the edges
// between them lie at edges of the finer lattice, up to half of its step away. From code to code
// that goes up and down as a wave or a saw tooth, and is looked for where one was found.
class Quantization final : public Effect {
 public:
  std::string id() const override { return "adc.quantization"; }
  Subject subject() const override { return Subject::sensor; }
  bool at_converter() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"lsb", "V", ParameterRole::index},
            {"origin", "V", ParameterRole::index},
            {"noise", "V", ParameterRole::shape}};
  }
  double choice_uncertainty(const VisitLog& log, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    if (k != 0) return 0;
    if (log.codes[axis].coarser_lattice) return log.codes[axis].coarser_lattice->u_step_V();
    if (!shows_other_step(log, axis)) return 0;
    // Rectangular between the neighbours that were looked at.
    return std::abs(stretched(log, axis, p[0], kApart) - p[0]) / std::numbers::sqrt3;
  }
  // Against a declared step the codes prove a coarser one; without it they only suggest one.
  bool certain(const VisitLog& log, std::size_t axis) const override {
    return log.codes[axis].coarser_lattice.has_value();
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    // Of a finer step nothing is known: half the declared one, with an edge at every edge between
    // two codes, changes nothing.
    if (shows_other_step(log, axis)) {
      const double declared_V = log.adc->lsb_V();
      return {{{0.5 * declared_V, log.adc->min_V + 0.25 * declared_V, log.input_sd_V[axis]}}};
    }
    // Without a declared converter the smallest difference between two readings is its step.
    const std::optional<Lattice> lattice =
        log.adc ? log.codes[axis].coarser_lattice
                : std::optional(Lattice{log.smallest_step_V[axis], log.lowest_V[axis]});
    // Noise of more than a step hides rounding from the means.
    if (!lattice || lattice->step_V == 0 || log.input_sd_V[axis] > 0.7 * lattice->step_V) return {};
    const double noise_V = std::max(log.input_sd_V[axis], effect::kLeastNoise * lattice->step_V);
    return {{{lattice->step_V, lattice->origin_V, noise_V}}};
  }
  std::vector<std::vector<double>> one_deviation_away(const VisitLog& log, std::size_t axis,
                                                      const std::vector<double>& p) const override {
    std::vector<std::vector<double>> away;
    if (!log.codes[axis].coarser_lattice) return away;
    for (const auto& [step_V, origin_V] : log.codes[axis].coarser_lattice->deviation)
      away.push_back({p[0] + step_V, p[1] + origin_V, p[2]});
    return away;
  }
  // Other lattices that the codes allow, or what lies between those that were looked at.
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t axis,
                                 const Hypothesis& found) const override {
    if (const auto& lattice = log.codes[axis].coarser_lattice) {
      std::vector<Hypothesis> others;
      const auto& [first, second] = lattice->deviation;
      for (const double a : {-1.5, -0.75, 0.0, 0.75, 1.5})
        for (const double b : {-1.5, -0.75, 0.0, 0.75, 1.5})
          others.push_back(
              {{lattice->step_V + a * first.step_V + b * second.step_V,
                lattice->origin_V + a * first.origin_V + b * second.origin_V, found.p[2]}});
      return others;
    }
    if (!shows_other_step(log, axis)) return {};
    std::vector<Hypothesis> others;
    for (int nearby = -kFiner; nearby <= kFiner; ++nearby)
      for (int place = -kFiner; place <= kFiner; ++place)
        others.push_back({{stretched(log, axis, found.p[0], kApart * nearby / (2 * kFiner)),
                           found.p[1] + found.p[0] * place / (2 * kFiner * kPlaces), found.p[2]}});
    return others;
  }
  std::vector<Hypothesis> in_one(const VisitLog& log, std::size_t axis, const Effect& repeated,
                                 const std::vector<std::vector<double>>& instances) const override {
    if (!repeated.id().starts_with("unlisted:code_") || instances.size() != 1 ||
        !shows_other_step(log, axis) || !(is_wave(repeated) || is_saw_tooth(repeated)))
      return {};  // another shape in the codes is something else
    return steps_with_wave(log, axis, instances.front()[1], kNearby);
  }
  double term_g(const TermInput& input, const double* p) const override {
    if (is_finer(input.log, p[0])) return finer_term_g(input, p);
    const double lsb_V = p[0];
    const double sd = std::min(p[2] / lsb_V, effect::kMostNoise);
    const double value = (input.output_V - p[1]) / lsb_V;  // in steps, from the origin
    const double reach = 0.5 + effect::kReach * sd;
    double rounded_V = 0, below = 0;
    const double first = std::round(value - reach);
    const int points = effect::whole_numbers(first, std::ceil(value + reach));
    for (int k = 0; k < points; ++k) {
      const double point = first + k;
      const double upper = effect::share_below(point + 0.5, value, sd);
      rounded_V += (upper - below) * reading_V(input, p, point);
      below = upper;
    }
    return (rounded_V - input.output_V) / input.K_V_per_g;
  }

 private:
  static bool is_finer(const VisitLog& log, double lsb_V) {
    return log.adc && lsb_V < log.adc->lsb_V();
  }
  /// Whether readings near an edge between two codes tell where it lies: there is noise that takes
  /// them over it, and not so much that all edges are one.
  static bool shows_other_step(const VisitLog& log, std::size_t axis) {
    if (!log.adc || log.codes[axis].any()) return false;
    const double noise = log.input_sd_V[axis] / log.adc->lsb_V();
    return noise > kLeastOfStep && noise < kMostOfStep;
  }
  /// A step of which the edges run through `turns` more by the other end of the readings.
  static double stretched(const VisitLog& log, std::size_t axis, double lsb_V, double turns) {
    return 1 / (1 / lsb_V + turns / (log.highest_V[axis] - log.lowest_V[axis]));
  }
  /// Steps with a wave of this period from code to code: seen at the edges between codes only, one
  /// of 1/lsb = n/declared ± 1/period looks the same for every n.
  static std::vector<Hypothesis> steps_with_wave(const VisitLog& log, std::size_t axis,
                                                 double period_V, int most_nearby) {
    constexpr double kFinest = 0.2;  // of the declared step; finer ones shift no edge enough
    constexpr double kCoarsest = 2;  // beyond, the codes show it
    const double declared_V = log.adc->lsb_V();
    // Places are counted from the middle of the readings, so that they do not depend on the step.
    const double middle_V = 0.5 * (log.highest_V[axis] + log.lowest_V[axis]);
    std::vector<Hypothesis> found;
    for (int n = 0; n <= static_cast<int>(1 / kFinest); ++n) {
      for (const int side : {-1, 1}) {
        const double per_V = n / declared_V + side / period_V;
        if (!(per_V > 0)) continue;
        for (int nearby = -most_nearby; nearby <= most_nearby; ++nearby) {
          const double lsb_V = stretched(log, axis, 1 / per_V, kApart * nearby);
          if (!(lsb_V > kFinest * declared_V && lsb_V < kCoarsest * declared_V)) continue;
          for (int place = 0; place < kPlaces; ++place)
            found.push_back({{lsb_V, middle_V + lsb_V * place / kPlaces, log.input_sd_V[axis]}});
        }
      }
    }
    return found;
  }
  /// By how much more a reading says that was rounded to the finer lattice first, undone like
  /// rounding to the declared one: over the slope of the mean reading there.
  static double finer_term_g(const TermInput& input, const double* p) {
    constexpr double kFlattest = 0.1;  // between two edges a mean says little
    const Adc& adc = *input.log.adc;
    const double declared_V = adc.lsb_V(), value_V = input.output_V;
    const double sd_V = std::clamp(p[2], kLeastOfStep * declared_V, declared_V);
    // Beyond, both edges are on the same side of all noise.
    const double reach_V = effect::kReach * sd_V + 0.5 * p[0];
    const double first = std::ceil((value_V - reach_V - adc.min_V) / declared_V - 0.5);
    const double last = std::floor((value_V + reach_V - adc.min_V) / declared_V - 0.5);
    double more_V = 0, slope = 0;
    const int codes = effect::whole_numbers(first, last);
    for (int k = 0; k < codes; ++k) {
      const double edge_V = adc.min_V + declared_V * (first + k + 0.5);
      const double finer_V = p[1] + p[0] * (std::floor((edge_V - p[1]) / p[0]) + 0.5);
      more_V += declared_V * (effect::share_below(edge_V, value_V, sd_V) -
                              effect::share_below(finer_V, value_V, sd_V));
      const double away = (edge_V - value_V) / sd_V;
      slope += declared_V / sd_V * std::exp(-0.5 * away * away) / std::sqrt(2 * std::numbers::pi);
    }
    return more_V / std::max(slope, kFlattest) / input.K_V_per_g;
  }

  static constexpr int kNearby = 5, kPlaces = 12;
  static constexpr int kFiner = 3;        // to each side, half way to the next of those
  static constexpr double kApart = 0.06;  // of steps: turns of the phase over all readings
  static constexpr double kLeastOfStep = 0.1, kMostOfStep = 0.5;  // of noise, declared steps

  /// What the declared converter makes of a point of the coarser lattice.
  static double reading_V(const TermInput& input, const double* p, double point) {
    const double at_V = p[1] + p[0] * point;
    // The readings at hand need not be those that the step was found in: theirs may begin
    // elsewhere.
    if (const auto& lattice = input.log.codes[input.axis].coarser_lattice) {
      const double seen_V =
          lattice->seen_V(std::round((at_V - lattice->origin_V) / lattice->step_V));
      if (std::abs(seen_V - at_V) < 0.5 * p[0]) return seen_V;  // NaN: never seen
    }
    const auto& adc = input.log.adc;
    return adc ? adc->min_V + adc->lsb_V() * std::round((at_V - adc->min_V) / adc->lsb_V()) : at_V;
  }
};

}  // namespace

const Effect& adc_quantization() {
  static const Quantization instance;
  return instance;
}

}  // namespace plumbline
