#include <cmath>
#include <numbers>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Mains pickup: A·sin(2πft + φ) in every sample. It lives inside the dwell; in the means only what
// averaging leaves of it is seen, so the frequency comes from the samples (diagnosis/dwell.h).
class MainsPickup final : public Effect {
 public:
  std::string id() const override { return "adc.mains_pickup"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"amplitude_sin", "g", ParameterRole::amplitude},
            {"amplitude_cos", "g", ParameterRole::amplitude},
            {"f", "Hz", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override { return {}; }
  double term_g(const TermInput& input, const double* p) const override {
    const Visit& visit = input.at();
    const double omega = 2 * std::numbers::pi * p[2];
    const auto n = static_cast<double>(visit.count);
    // Mean of n equally spaced values of a sine: Dirichlet's kernel about the middle of the dwell.
    const double half = 0.5 * omega * visit.step_s;
    const double kernel =
        std::abs(std::sin(half)) < 1e-12 ? 1 : std::sin(n * half) / (n * std::sin(half));
    const double phase = omega * (visit.t_arrival_s + 0.5 * (n - 1) * visit.step_s);
    return kernel * (p[0] * std::sin(phase) + p[1] * std::cos(phase));
  }
};

}  // namespace

const Effect& adc_mains_pickup() {
  static const MainsPickup instance;
  return instance;
}

}  // namespace plumbline
