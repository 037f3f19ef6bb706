#include <algorithm>
#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Bias that jumps once: b for t ≥ t0. Between two poses the instant cannot be told; a jump while
// the head rests shows in part of the samples.
class BiasStep final : public Effect {
 public:
  std::string id() const override { return "sensor.bias_step"; }
  Subject subject() const override { return Subject::sensor; }
  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"b", "g", ParameterRole::amplitude}, effect::instant("t0")};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    std::vector<Hypothesis> starts;
    for (std::size_t k = 1; k < log.visits.size(); ++k) {
      starts.push_back({{effect::kSmallTerm, log.visits[k].t_arrival_s}});
    }
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> within;
    for (std::size_t k = 0; k < log.visits.size(); ++k) {
      const bool after = log.visits[k].t_arrival_s == found.p[1];
      const bool before = k + 1 < log.visits.size() && log.visits[k + 1].t_arrival_s == found.p[1];
      if (!after && !before) continue;
      const Visit& visit = log.visits[k];
      for (std::size_t part = 1; part < effect::kPartsOfDwell; ++part) {
        const std::size_t sample = visit.count * part / effect::kPartsOfDwell;
        const double into_s = visit.step_s * static_cast<double>(sample);
        within.push_back({{found.p[0], visit.t_arrival_s + into_s}});
      }
    }
    return within;
  }
  std::optional<std::size_t> sets_in_at(const VisitLog& log,
                                        const std::vector<double>& p) const override {
    for (std::size_t k = 0; k < log.visits.size(); ++k)
      if (log.visits[k].t_arrival_s == p[1]) return k;
    return {};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return term(input.at(), p);
  }
  bool same_numbers_on_axes() const override { return true; }
  std::vector<double> numbers_of_visits(const VisitLog& log, std::size_t,
                                        const double* p) const override {
    std::vector<double> numbers;
    for (const Visit& visit : log.visits) numbers.push_back(term(visit, p));
    return numbers;
  }

 private:
  static double term(const Visit& visit, const double* p) { return p[0] * share_from(visit, p[1]); }
  /// Share of the samples of a visit at or after an instant.
  static double share_from(const Visit& visit, double t_s) {
    if (t_s <= visit.t_arrival_s) return 1;
    if (visit.count < 2) return 0;
    constexpr double kSame = 1e-6;  // of the time between samples
    const auto count = static_cast<double>(visit.count);
    const double before = std::ceil((t_s - visit.t_arrival_s) / visit.step_s - kSame);
    return std::max(0.0, count - before) / count;
  }
};

}  // namespace

const Effect& sensor_bias_step() {
  static const BiasStep instance;
  return instance;
}

}  // namespace plumbline
