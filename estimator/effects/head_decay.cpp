#include "estimator/effects/head_decay.h"

#include <cmath>

#include "estimator/effects/head_in_dwell.h"

namespace plumbline {
namespace {

class HeadDecay final : public HeadInDwell {
 public:
  HeadDecay(double HeadGeometry::*angle, DecayOf of) : HeadInDwell(angle), of_(of) {}

  std::string shape() const override {
    switch (of_) {
      case DecayOf::one:
        break;
      case DecayOf::weight:
        return HeadInDwell::shape() + ", times the cosine of h";
      case DecayOf::way:
        return HeadInDwell::shape() + ", times the way turned";
    }
    return HeadInDwell::shape();
  }
  bool remembers() const override { return of_ == DecayOf::way; }
  bool guesses_at_start() const override { return remembers(); }
  std::vector<ParameterInfo> parameters() const override {
    // true_at 0: the angle is right in the end; 1: it was right on arrival.
    return {{"c", of_ == DecayOf::way ? "" : "deg", ParameterRole::amplitude},
            {"tau", "s", ParameterRole::shape},
            {"true_at", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const Visit& visit = log.visits.front();
    const double dwell_s = visit.duration_s();
    if (!(dwell_s > 0)) return {};
    const double size = of_ == DecayOf::way ? effect::kSmallTerm : effect::kSmallAngle_deg;
    std::vector<Hypothesis> starts;
    for (const double tau_s : effect::geometric(dwell_s / 10, dwell_s * 3, 6))
      for (const double true_at : {0.0, 1.0}) starts.push_back({{size, tau_s, true_at}});
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const Visit& at = log.visits[visit];
    const double decay = effect::mean_decay(at, at.t_arrival_s, p[1]);
    head.*angle() += size_rad(log, visit, p) * (decay - (p[2] > 0.5 ? 1 : 0));
  }
  AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const override {
    const Eigen::ArrayXd decay = effect::decay_since_arrival(log.visits[visit], p[1]);
    return {angle(), size_rad(log, visit, p) * (decay - (p[2] > 0.5 ? 1 : 0)).matrix()};
  }

 private:
  std::string function() const override { return "exponential after arrival"; }
  /// From arrival to the end.
  double size_rad(const VisitLog& log, std::size_t visit, const double* p) const {
    const Visit& at = log.visits[visit];
    switch (of_) {
      case DecayOf::one:
        break;
      case DecayOf::weight:
        return p[0] * std::cos(at.h_rad) * kRadPerDeg;
      case DecayOf::way: {
        const Visit* before = log.before(visit);
        if (before == nullptr) return 0;
        return p[0] * (is_delta() ? shorter_turn_rad(at, *before) : before->h_rad - at.h_rad);
      }
    }
    return p[0] * kRadPerDeg;
  }

  DecayOf of_;
};

class HeadRinging final : public HeadInDwell {
 public:
  using HeadInDwell::HeadInDwell;

  std::vector<ParameterInfo> parameters() const override {
    return {{"f", "Hz", ParameterRole::shape},
            {"tau", "s", ParameterRole::shape},
            {"c", "deg", ParameterRole::amplitude},
            {"s", "deg", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    std::vector<Hypothesis> starts = effect::starts_of_ringing(log.visits.front());
    for (Hypothesis& start : starts) start.p[2] = start.p[3] = effect::kSmallAngle_deg;
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.*angle() += effect::mean_of_ringing(log.visits[visit], p) * kRadPerDeg;
  }
  AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const override {
    return {angle(), effect::ringing(log.visits[visit], p) * kRadPerDeg};
  }

 private:
  std::string function() const override { return "ringing that dies away"; }
};

}  // namespace

std::unique_ptr<SmoothTerm> head_ringing(double HeadGeometry::*angle) {
  return std::make_unique<HeadRinging>(angle);
}

std::unique_ptr<SmoothTerm> head_decay(double HeadGeometry::*angle, DecayOf of) {
  return std::make_unique<HeadDecay>(angle, of);
}

}  // namespace plumbline
