#include <algorithm>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Warm-up since the start of the run: b·exp(−t/τ).
class WarmUp final : public Effect {
 public:
  std::string id() const override { return "sensor.warmup"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"b", "g", ParameterRole::amplitude}, {"tau", "s", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // Slower than the run it is a drift, faster than a few poses it is over before it is seen.
    const double span_s = log.last_s() - log.first_s();
    if (!(span_s > 0)) return {};
    // Before the first pose all but e⁻⁵ of a still faster one is over, however large it was.
    const double fastest_s = std::max(span_s / 100, log.first_s() / 5);
    if (!(fastest_s < span_s / 1.5)) return {};
    std::vector<Hypothesis> starts;
    for (double tau_s : effect::geometric(fastest_s, span_s / 1.5, 12)) {
      starts.push_back({{effect::kSmallTerm, tau_s}});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * effect::mean_decay(input.at(), 0, p[1]);
  }
};

}  // namespace

const Effect& sensor_warmup() {
  static const WarmUp instance;
  return instance;
}

}  // namespace plumbline
