#include <cmath>
#include <cstdint>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// One bit of the code held at 0 or 1.
class StuckBit final : public Effect {
 public:
  std::string id() const override { return "adc.stuck_bit"; }
  Subject subject() const override { return Subject::sensor; }
  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"bit", "", ParameterRole::index}, {"value", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    if (!log.adc) return {};
    std::vector<Hypothesis> starts;
    for (int bit = 0; bit < log.adc->bits; ++bit) {
      starts.push_back({{static_cast<double>(bit), 0}});
      starts.push_back({{static_cast<double>(bit), 1}});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const Adc& adc = *input.log.adc;
    const auto bit = std::int64_t{1} << static_cast<int>(p[0]);
    const bool set = p[1] > 0.5;
    // The bits of the code counted from the lower end of the span.
    const auto shift_V = [&](double u_V) {
      const auto code =
          static_cast<std::int64_t>(std::floor((u_V - adc.min_V) / adc.lsb_V() + 0.5));
      const bool is_set = (code & bit) != 0;
      if (is_set == set) return 0.0;
      return (set ? 1.0 : -1.0) * static_cast<double>(bit) * adc.lsb_V();
    };
    return effect::mean_over_noise(shift_V, input.output_V, input.log.sample_sd_V[input.axis]) /
           input.K_V_per_g;
  }
};

}  // namespace

const Effect& adc_stuck_bit() {
  static const StuckBit instance;
  return instance;
}

}  // namespace plumbline
