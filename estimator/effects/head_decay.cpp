#include "estimator/effects/head_decay.h"

#include <cmath>

#include "estimator/effects/head_in_dwell.h"

namespace plumbline {
namespace {

/// Proportional to what every arrival sets off.
class SetOff : public HeadInDwell {
 public:
  SetOff(double HeadGeometry::*angle, SetOffBy by) : HeadInDwell(angle), by_(by) {}

  std::string shape() const override {
    const char* const times = by_ == SetOffBy::weight      ? ", times the cosine of h"
                              : by_ == SetOffBy::way       ? ", times the way turned"
                              : by_ == SetOffBy::direction ? ", times the direction of the way"
                                                           : "";
    return HeadInDwell::shape() + times;
  }
  bool remembers() const override { return by_ == SetOffBy::way || by_ == SetOffBy::direction; }
  bool guesses_at_start() const override { return remembers(); }

 protected:
  ParameterInfo amplitude(const char* name) const {
    return {name, by_ == SetOffBy::way ? "" : "deg", ParameterRole::amplitude};
  }
  double typical_size() const {
    return by_ == SetOffBy::way ? effect::kSmallTerm : effect::kSmallAngle_deg;
  }
  /// For an amplitude of 1.
  double size_rad(const VisitLog& log, std::size_t visit) const {
    const Visit& at = log.visits[visit];
    switch (by_) {
      case SetOffBy::arrival:
        break;
      case SetOffBy::weight:
        return std::cos(at.h_rad) * kRadPerDeg;
      case SetOffBy::way:
        if (log.before(visit) == nullptr) return 0;
        return is_delta() ? shorter_turn_rad(at, *log.before(visit))
                          : log.before(visit)->h_rad - at.h_rad;
      case SetOffBy::direction:
        return -kRadPerDeg * (is_delta() ? at.delta_direction[0] : last_direction_of_h(log, visit));
    }
    return kRadPerDeg;
  }

 private:
  SetOffBy by_;
};

class HeadDecay final : public SetOff {
 public:
  using SetOff::SetOff;

  std::vector<ParameterInfo> parameters() const override {
    // true_at 0: the angle is right in the end; 1: it was right on arrival; 2: on average.
    return {
        amplitude("c"), {"tau", "s", ParameterRole::shape}, {"true_at", "", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const Visit& visit = log.visits.front();
    const double dwell_s = visit.duration_s();
    if (!(dwell_s > 0)) return {};
    std::vector<Hypothesis> starts;
    for (const double tau_s : effect::geometric(dwell_s / 10, dwell_s * 3, 6))
      for (const double true_at : {kInTheEnd, kOnArrival, kOnAverage})
        starts.push_back({{typical_size(), tau_s, true_at}});
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    const Visit& at = log.visits[visit];
    const double decay = effect::mean_decay(at, at.t_arrival_s, p[1]);
    head.*angle() += p[0] * size_rad(log, visit) * (decay - at_truth(at, p));
  }
  AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const override {
    const Visit& at = log.visits[visit];
    const Eigen::ArrayXd decay = effect::decay_since_arrival(at, p[1]);
    return {angle(), p[0] * size_rad(log, visit) * (decay - at_truth(at, p)).matrix()};
  }

 private:
  static constexpr double kInTheEnd = 0, kOnArrival = 1, kOnAverage = 2;

  /// What is left of the decay where the angle is right.
  static double at_truth(const Visit& at, const double* p) {
    if (p[2] == kInTheEnd) return 0;
    return p[2] == kOnArrival ? 1 : effect::mean_decay(at, at.t_arrival_s, p[1]);
  }
  std::string function() const override { return "exponential after arrival"; }
};

class HeadRinging final : public SetOff {
 public:
  using SetOff::SetOff;

  std::vector<ParameterInfo> parameters() const override {
    return {{"f", "Hz", ParameterRole::shape},
            {"tau", "s", ParameterRole::shape},
            amplitude("c"),
            amplitude("s")};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    std::vector<Hypothesis> starts = effect::starts_of_ringing(log.visits.front());
    for (Hypothesis& start : starts) start.p[2] = start.p[3] = typical_size();
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.*angle() += effect::mean_of_ringing(log.visits[visit], p) * size_rad(log, visit);
  }
  AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const override {
    return {angle(), effect::ringing(log.visits[visit], p) * size_rad(log, visit)};
  }

 private:
  std::string function() const override { return "ringing that dies away"; }
};

}  // namespace

std::unique_ptr<SmoothTerm> head_ringing(double HeadGeometry::*angle, SetOffBy by) {
  return std::make_unique<HeadRinging>(angle, by);
}

std::unique_ptr<SmoothTerm> head_decay(double HeadGeometry::*angle, SetOffBy by) {
  return std::make_unique<HeadDecay>(angle, by);
}

}  // namespace plumbline
