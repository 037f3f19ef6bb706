#include <cmath>

#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Slow settling after a move: c·(a_i of the previous pose − a_i)·exp(−(t − t_arrival)/τ).
class Settling final : public Effect {
 public:
  std::string id() const override { return "sensor.settling"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"c", "", ParameterRole::amplitude}, {"tau", "s", ParameterRole::shape}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const Visit& visit = log.visits.front();
    const double dwell_s = visit.step_s * static_cast<double>(visit.count);
    if (!(dwell_s > 0)) return {};
    std::vector<Hypothesis> starts;
    for (double tau_s : effect::geometric(dwell_s / 10, dwell_s * 10, 8)) {
      starts.push_back({{effect::kSmallTerm, tau_s}});
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * came_from_g(input) * effect::mean_decay(input.at(), input.at().t_arrival_s, p[1]);
  }
  bool remembers() const override { return true; }
  bool within_dwell() const override { return true; }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return p[0] * came_from_g(input) * effect::decay_since_arrival(input.at(), p[1]).matrix();
  }

 private:
  static double came_from_g(const TermInput& input) {
    if (input.log.before(input.visit) == nullptr) return 0;
    const auto i = static_cast<Eigen::Index>(input.axis);
    return input.a_g[input.visit - 1](i) - input.a_g[input.visit](i);
  }
};

}  // namespace

const Effect& sensor_settling() {
  static const Settling instance;
  return instance;
}

}  // namespace plumbline
