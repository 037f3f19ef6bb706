// What all functions of one driver have in common.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "estimator/effects/function_of_driver.h"

namespace plumbline {

/// A function of one driver; the shape is the derived class's.
class DrivenTerm : public SmoothTerm {
 public:
  DrivenTerm(DriverPointer driver, Target target)
      : driver_(std::move(driver)),
        target_(target),
        range_(driver_->span ? *driver_->span : range_of(driver_->value)) {}

  std::string id() const override {
    return "unlisted:" + driver_->name + ":" + to_string(target_.form);
  }
  const std::string& driver() const override { return driver_->name; }
  TermForm form() const override { return target_.form; }
  std::string shape() const override {
    return function() + (driver_->past.empty() ? "" : " in the " + driver_->past) + target_.words();
  }
  Subject subject() const override {
    return target_.form == TermForm::geometry ? Subject::head : Subject::sensor;
  }
  /// What other axes do with the codes of one they do with the component that these stand for.
  bool acts_on(std::size_t axis) const override {
    return driver_->output_of.value_or(axis) == axis;
  }
  bool at_converter() const override { return driver_->output_of.has_value(); }
  bool remembers() const override { return !driver_->past.empty() || driver_->is_rate(); }
  bool guesses_at_start() const override { return !driver_->past.empty(); }
  std::vector<std::string> columns() const override { return driver_->columns(); }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    displace_by_number(log, visit, of_visit(0, visit, p), p, head);
  }
  void displace_by_number(const VisitLog& log, std::size_t visit, double f, const double*,
                          HeadGeometry& head) const override {
    head.*target_.angle += f * target_.factor_at(log.visits[visit]) * kRadPerDeg;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double f = driver_->output_of == input.axis ? at(input.output_V, p)
                                                      : of_visit(input.axis, input.visit, p);
    return term_of_number_g(input, f);
  }
  ForceFactor factor() const override { return target_.factor(); }
  bool same_numbers_on_axes() const override {
    return driver_->same_on_axes && !driver_->output_of;
  }
  /// What tilts the base towards a direction may do so along an axis after all.
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& p) const override {
    const auto* other = dynamic_cast<const SmoothTerm*>(&repeated);
    const bool along_an_axis = target_.words() == kH.words() || target_.words() == kRoll.words();
    if (!along_an_axis || other == nullptr || p.size() != 1 ||
        p.front().size() != parameters().size() + 1 ||
        !other->is(driver(), to_string(form()), function() + kTilt.words()))
      return {};
    return {{{p.front().begin(), p.front().end() - 1}}};
  }
  std::vector<double> numbers_of_visits(const VisitLog& log, std::size_t axis,
                                        const double* p) const override {
    std::vector<double> f;
    if (driver_->output_of == axis) return f;  // the model's
    for (std::size_t visit = 0; visit < log.visits.size(); ++visit)
      f.push_back(of_visit(axis, visit, p));
    return f;
  }

 protected:
  virtual std::string function() const = 0;
  /// The function at one value of the driver, for those that depend on nothing else.
  virtual double at(double, const double*) const { return 0; }
  virtual double of_visit(std::size_t axis, std::size_t visit, const double* p) const {
    return at(driver_->value[axis][visit], p);
  }

  /// The last parameter of what has a mean that the 12 parameters do not hold.
  void add_mean(std::vector<ParameterInfo>& infos) const {
    if (!target_.mean_in_the_twelve())
      infos.push_back({"p0", target_.unit(), ParameterRole::amplitude});
  }
  /// `p` without that mean, and with it where there is one.
  void add_with_mean(std::vector<double> p, std::vector<Hypothesis>& starts) const {
    if (target_.mean_in_the_twelve()) {
      starts.push_back({std::move(p)});
      return;
    }
    p.push_back(0);
    starts.push_back({p});
    p.back() = target_.typical_size();
    starts.push_back({std::move(p)});
  }
  double mean(const double* p0) const { return target_.mean_in_the_twelve() ? 0 : *p0; }
  /// A place in the range.
  ParameterInfo place(const char* name) const {
    const auto [low, high] = range();
    constexpr double kFine = 1e-3;
    return {name, variable().unit(), ParameterRole::shape, kFine * (high - low), true};
  }
  /// What an axis does again and again over its range it does by its own component.
  bool is_of_another_axis(std::size_t axis) const {
    return driver_->component.value_or(axis) != axis;
  }
  /// A scale that follows the component that it multiplies is a bias that does.
  bool is_bias_in_disguise(std::size_t axis) const {
    return target_.form == TermForm::scale && !target_.second &&
           driver_->component == (axis + target_.other) % kAxisCount;
  }
  /// Of a clock: the share of a visit's dwell between two times.
  double share_between(std::size_t axis, std::size_t visit, double from_s, double to_s) const {
    const double middle_s = driver_->value[axis][visit], half_s = 0.5 * driver_->dwell_s[visit];
    if (!(half_s > 0)) return middle_s > from_s && middle_s < to_s ? 1 : 0;
    const double there_s = std::min(middle_s + half_s, to_s) - std::max(middle_s - half_s, from_s);
    return std::clamp(there_s / (2 * half_s), 0.0, 1.0);
  }
  /// A part of what lies between two visits, over which an edge is spread so that it can be moved.
  double part_of_spacing() const {
    constexpr double kPart = 0.25;
    return kPart * (range_.second - range_.first) /
           static_cast<double>(driver_->value.front().size());
  }
  /// Where the range begins; what began when the clock did may not have waited for the first pose.
  std::vector<double> beginnings() const {
    constexpr double kSoonAfter = 0.1;  // as a share of the run
    const auto [low, high] = range_;
    if (driver_->span) return {0};  // about which it lies
    std::vector<double> found = {low};
    if (driver_->is_clock() && low > 0 && low < kSoonAfter * (high - low)) found.push_back(0);
    return found;
  }
  /// In the middle between the two visits that a time lies between.
  double half_way_between_visits(double t_s) const {
    const std::vector<double>& times_s = driver_->value[0];
    const auto after = std::upper_bound(times_s.begin(), times_s.end(), t_s);
    if (after == times_s.begin() || after == times_s.end()) return t_s;
    return 0.5 * (*(after - 1) + *after);
  }
  const std::pair<double, double>& range() const { return range_; }
  /// Whether the driver took enough different values to tell a polynomial of this degree.
  bool resolves(int degree) const {
    constexpr double kPerDegree = 1.5;
    return static_cast<double>(driver_->fewest_values) >= kPerDegree * degree;
  }
  const Driver& variable() const { return *driver_; }
  const Target& target() const { return target_; }
  /// Whether what is linear in the driver is not to be told from the 12 parameters.
  bool is_in_the_twelve() const { return driver_->in_the_twelve && target_.form == TermForm::bias; }

 private:
  static std::pair<double, double> range_of(const PerAxis<std::vector<double>>& of_axis) {
    constexpr double kBeyond = std::numeric_limits<double>::infinity();
    std::pair<double, double> range{kBeyond, -kBeyond};
    for (const auto& values : of_axis)
      for (const double value : values)
        range = {std::min(range.first, value), std::max(range.second, value)};
    return range;
  }
  DriverPointer driver_;
  Target target_;
  std::pair<double, double> range_;  ///< asked for whenever a parameter is described
};

}  // namespace plumbline
