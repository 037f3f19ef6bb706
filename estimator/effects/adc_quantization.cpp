#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Rounding to a step that the description of the run does not declare. How far the noise of a
// reading rounds the stairs off is estimated with it: readings that hardly change say little of it.
class Quantization final : public Effect {
 public:
  std::string id() const override { return "adc.quantization"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"lsb", "V", ParameterRole::index},
            {"origin", "V", ParameterRole::index},
            {"noise", "V", ParameterRole::shape}};
  }
  double choice_uncertainty(const VisitLog& log, std::size_t axis, std::size_t k) const override {
    return k == 0 && log.codes[axis].coarser_lattice ? log.codes[axis].coarser_lattice->u_step_V
                                                     : 0;
  }
  // Against a declared step the codes prove a coarser one; without it they only suggest one.
  bool certain(const VisitLog& log) const override { return log.adc.has_value(); }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    // Without a declared converter the smallest difference between two readings is its step.
    const std::optional<Lattice> lattice =
        log.adc ? log.codes[axis].coarser_lattice
                : std::optional(Lattice{log.smallest_step_V[axis], log.lowest_V[axis]});
    // Noise of more than a step hides rounding from the means.
    if (!lattice || lattice->step_V == 0 || log.input_sd_V[axis] > 0.7 * lattice->step_V) return {};
    const double noise_V = std::max(log.input_sd_V[axis], effect::kLeastNoise * lattice->step_V);
    return {{{lattice->step_V, lattice->origin_V, noise_V}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double lsb_V = p[0];
    const double sd = std::min(p[2] / lsb_V, effect::kMostNoise);
    const double value = (input.output_V - p[1]) / lsb_V;  // in steps, from the origin
    const double reach = 0.5 + effect::kReach * sd;
    double rounded_V = 0, below = 0;
    for (double point = std::round(value - reach); point < value + reach + 1; ++point) {
      const double upper = effect::share_below(point + 0.5, value, sd);
      rounded_V += (upper - below) * reading_V(input, p, point);
      below = upper;
    }
    return (rounded_V - input.output_V) / input.K_V_per_g;
  }

 private:
  /// What the declared converter makes of a point of the coarser lattice.
  static double reading_V(const TermInput& input, const double* p, double point) {
    const double at_V = p[1] + p[0] * point;
    const auto& lattice = input.log.codes[input.axis].coarser_lattice;
    if (lattice && point >= 0 && point < static_cast<double>(lattice->second_rounding_V.size())) {
      const double second_V = lattice->second_rounding_V[static_cast<std::size_t>(point)];
      if (!std::isnan(second_V)) return at_V + second_V;
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
