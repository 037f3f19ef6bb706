#include <algorithm>
#include <vector>

#include "estimator/effects/effect.h"
#include "estimator/effects/place.h"

namespace plumbline {
namespace {

// A step at one code boundary: c·sign(U − U_c). Noise within the dwell rounds it off.
class CodeStep final : public Effect {
 public:
  std::string id() const override { return "adc.code_step"; }
  Subject subject() const override { return Subject::sensor; }
  bool repeats() const override { return true; }
  bool at_converter() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine_V = 2e-5;  // well within the noise that rounds the step off
    return {{"c", "V", ParameterRole::amplitude}, {"at", "V", ParameterRole::shape, kFine_V, true}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<double> sorted_V = means_V(log, axis);
    std::sort(sorted_V.begin(), sorted_V.end());
    // All edges between the same two poses say the same; noise rounds a step off over some of its
    // standard deviations.
    const double apart_V = 1.5 * log.input_sd_V[axis];
    std::vector<Hypothesis> starts;
    double last_V = sorted_V.front();
    for (std::size_t k = 1; k < sorted_V.size(); ++k) {
      const double at_V = 0.5 * (sorted_V[k - 1] + sorted_V[k]);
      if (at_V - last_V < apart_V) continue;
      starts.push_back({{1e-5, at_V}});
      last_V = at_V;
    }
    return starts;
  }
  // Where few poses see the edge, the gain has several peaks.
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t axis,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    for (const double sds : {0.5, 1.0, 1.5, 2.0, 3.0, 4.0})
      for (const double side : {-1, 1})
        others.push_back({{found.p[0], found.p[1] + side * sds * log.input_sd_V[axis]}});
    return others;
  }
  // An edge that no reading sees lies somewhere between those next to it.
  double choice_uncertainty(const VisitLog& log, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    return k == kAt ? effect::u_between_neighbours(means_V(log, axis), p[kAt]) : 0;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double at_V = p[kAt];
    const double below =
        effect::share_below(at_V, input.output_V, input.log.input_sd_V[input.axis]);
    return p[0] / input.K_V_per_g * (1 - 2 * below);
  }

 private:
  static constexpr std::size_t kAt = 1;  // among its parameters

  static std::vector<double> means_V(const VisitLog& log, std::size_t axis) {
    std::vector<double> all_V;
    for (const Visit& visit : log.visits) all_V.push_back(visit.mean_V[axis]);
    return all_V;
  }
};

}  // namespace

const Effect& adc_code_step() {
  static const CodeStep instance;
  return instance;
}

}  // namespace plumbline
