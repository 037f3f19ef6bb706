#include "estimator/effects/telegraph.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {

Telegraph::Telegraph(DriverPointer clock, const Target& target, int switches)
    : DrivenTerm(std::move(clock), target), switches_(switches) {}

bool Telegraph::is_like(const Telegraph& other) const {
  return form() == other.form() && target().words() == other.target().words();
}

std::vector<ParameterInfo> Telegraph::parameters() const {
  std::vector<ParameterInfo> infos;
  for (int k = 1; k <= switches_; ++k) infos.push_back(effect::instant("t" + std::to_string(k)));
  infos.push_back({"p", target().unit(), ParameterRole::amplitude});
  return infos;
}

std::vector<Hypothesis> Telegraph::hypotheses(const VisitLog&, std::size_t) const {
  const auto [low, high] = range();
  Hypothesis regular;
  for (int k = 1; k <= switches_; ++k)
    regular.p.push_back(low + (high - low) * k / (switches_ + 1));
  regular.p.push_back(target().typical_size());
  return {regular};
}

double Telegraph::log_choices() const {
  return switches_ * std::log(static_cast<double>(variable().value.front().size()));
}

std::string Telegraph::function() const {
  return "two levels, from one to the other " + std::to_string(switches_) + " times";
}

double Telegraph::of_visit(std::size_t axis, std::size_t visit, const double* p) const {
  const double middle_s = variable().value[axis][visit];
  const double half_s = 0.5 * variable().dwell_s[visit];
  double there = 0;  // as a share of the dwell
  for (int k = 0; k < switches_; ++k) {
    const double share = half_s > 0
                             ? std::clamp((middle_s + half_s - p[k]) / (2 * half_s), 0.0, 1.0)
                             : (middle_s > p[k] ? 1.0 : 0.0);
    there += k % 2 == 0 ? share : -share;
  }
  return p[switches_] * there;
}

}  // namespace plumbline
