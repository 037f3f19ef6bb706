#include "estimator/effects/telegraph.h"

#include <cmath>
#include <limits>
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
  double there = 0;  // as a share of the dwell
  for (int k = 0; k < switches_; k += 2) {
    const double back_s = k + 1 < switches_ ? p[k + 1] : std::numeric_limits<double>::infinity();
    there += share_between(axis, visit, p[k], back_s);
  }
  return p[switches_] * there;
}

}  // namespace plumbline
