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
    return {{"lsb", "V", ParameterRole::shape},
            {"origin", "V", ParameterRole::index},
            {"noise", "V", ParameterRole::shape}};
  }
  // Against a declared step the codes prove a coarser one; without it they only suggest one.
  bool certain(const VisitLog& log) const override { return log.adc.has_value(); }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    // Without a declared converter the smallest difference between two readings is its step.
    const std::optional<Lattice> lattice =
        log.adc ? log.coarser_lattice[axis]
                : std::optional(Lattice{log.smallest_step_V[axis], log.lowest_V[axis]});
    // Noise of more than a step hides rounding from the means.
    if (!lattice || lattice->step_V == 0 || log.input_sd_V[axis] > 0.7 * lattice->step_V) return {};
    const double noise_V = std::max(log.input_sd_V[axis], effect::kLeastNoise * lattice->step_V);
    return {{{lattice->step_V, lattice->origin_V, noise_V}}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double lsb_V = p[0];
    const double sd = std::min(p[2] / lsb_V, effect::kMostNoise);
    const double value = (input.output_V - p[1]) / lsb_V;  // in steps, as all of this
    const double nearest = std::round(value);
    double rounded = nearest;
    for (double edge = 0.5; edge < 1 + effect::kReach * sd; ++edge) {
      rounded += 1 - effect::share_below(nearest + edge, value, sd);
      rounded -= effect::share_below(nearest - edge, value, sd);
    }
    return (rounded - value) * lsb_V / input.K_V_per_g;
  }
};

}  // namespace

const Effect& adc_quantization() {
  static const Quantization instance;
  return instance;
}

}  // namespace plumbline
