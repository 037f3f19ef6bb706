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
    return {{"c", "", ParameterRole::amplitude},
            {"tau", "s", ParameterRole::shape},
            {.name = "start", .unit = "", .role = ParameterRole::index, .unrecorded = true}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const Visit& visit = log.visits.front();
    const double dwell_s = visit.duration_s();
    if (!(dwell_s > 0)) return {};
    std::vector<Hypothesis> starts;
    for (double tau_s : effect::geometric(dwell_s / 10, dwell_s * 10, 8)) {
      starts.push_back({{effect::kSmallTerm, tau_s, kAtRest}});
    }
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t,
                                 const Hypothesis& found) const override {
    const Visit& first = log.visits.front();
    if (first.delta_rad == 0 && first.h_rad == 0) return {};
    return {{with_other_start(found.p)}};
  }
  // That this run began at the zero says nothing of a later set.
  std::vector<std::vector<double>> left_open_by(const RunHistory&,
                                                const std::vector<double>& p) const override {
    if (std::lround(p[2]) == kAtRest) return {};
    return {with_other_start(p)};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return p[0] * came_from_g(input, p) *
           effect::mean_decay(input.at(), input.at().t_arrival_s, p[1]);
  }
  bool remembers() const override { return true; }
  bool within_dwell() const override { return true; }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return p[0] * came_from_g(input, p) * effect::decay_since_arrival(input.at(), p[1]).matrix();
  }

 private:
  /// How the head came to its first pose, which nothing recorded says: it has been there for long,
  /// or it comes from its zero.
  enum Start { kAtRest, kFromZero };
  static std::vector<double> with_other_start(std::vector<double> p) {
    p[2] = std::lround(p[2]) == kAtRest ? kFromZero : kAtRest;
    return p;
  }
  static double came_from_g(const TermInput& input, const double* p) {
    const auto i = static_cast<Eigen::Index>(input.axis);
    if (input.log.before(input.visit) != nullptr)
      return input.a_g[input.visit - 1](i) - input.a_g[input.visit](i);
    if (std::lround(p[2]) == kAtRest) return 0;
    return specific_force_g({}, input.log.gamma)(i) - input.a_g[input.visit](i);
  }
};

}  // namespace

const Effect& sensor_settling() {
  static const Settling instance;
  return instance;
}

}  // namespace plumbline
