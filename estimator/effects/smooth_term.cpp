#include "estimator/effects/smooth_term.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include "estimator/effects/driver.h"

namespace plumbline {

const char* to_string(TermForm form) {
  switch (form) {
    case TermForm::bias:
      return "bias";
    case TermForm::scale:
      return "scale";
    case TermForm::sample:
      return "sample";
    case TermForm::geometry:
      break;
  }
  return "geometry";
}

namespace {

using DriverPointer = std::shared_ptr<const Driver>;

/// What a function of the visits acts on.
struct Target {
  TermForm form = TermForm::bias;
  std::size_t other = 0;  ///< scale: the component multiplied is that of axis i + other
  bool of_tilt = false;   ///< geometry: h instead of δ

  std::string words() const {
    if (form == TermForm::geometry) return of_tilt ? ", added to h" : ", added to delta";
    if (form != TermForm::scale || other == 0) return "";
    return other == 1 ? ", times the component of the next axis"
                      : ", times the component of the axis after the next";
  }
  const char* unit() const {
    return form == TermForm::geometry ? "deg" : form == TermForm::scale ? "" : "g";
  }
  double typical_size() const {
    return form == TermForm::geometry ? effect::kSmallAngle_deg : effect::kSmallTerm;
  }
};

/// A function of one driver; the shape is the derived class's.
class FunctionOfDriver : public SmoothTerm {
 public:
  FunctionOfDriver(DriverPointer driver, Target target)
      : driver_(std::move(driver)), target_(target) {}

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
  void displace(const VisitLog&, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    (target_.of_tilt ? head.h_rad : head.delta_rad) +=
        at(driver_->value[0][visit], p) * effect::kRadPerDeg;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double f = at(driver_->value[input.axis][input.visit], p);
    if (target_.form != TermForm::scale) return f;
    const std::size_t component = (input.axis + target_.other) % kAxisCount;
    return f * input.a_g[input.visit](static_cast<Eigen::Index>(component));
  }

 protected:
  virtual std::string function() const = 0;
  virtual double at(double value, const double* p) const = 0;

  std::pair<double, double> range() const {
    double low = driver_->value[0].front(), high = low;
    for (const auto& values : driver_->value) {
      const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
      low = std::min(low, *least);
      high = std::max(high, *greatest);
    }
    return {low, high};
  }
  const Target& target() const { return target_; }
  /// Whether what is linear in the driver is not to be told from the 12 parameters.
  bool is_in_the_twelve() const { return driver_->in_the_twelve && target_.form == TermForm::bias; }

 private:
  DriverPointer driver_;
  Target target_;
};

/// Legendre polynomials of degree 1 … d over the range that was seen.
class Polynomial final : public FunctionOfDriver {
 public:
  Polynomial(DriverPointer driver, Target target, int degree)
      : FunctionOfDriver(std::move(driver), target), degree_(degree) {}

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"low", "", ParameterRole::index},
                                        {"high", "", ParameterRole::index}};
    for (int d = 1; d <= degree_; ++d)
      infos.push_back({"p" + std::to_string(d), target().unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<double> p(parameters().size(), target().typical_size());
    std::tie(p[0], p[1]) = range();
    if (is_in_the_twelve()) {
      if (degree_ == 1) return {};
      p[2] = 0;
    }
    return {{std::move(p)}};
  }

 private:
  std::string function() const override {
    return "polynomial of degree " + std::to_string(degree_);
  }
  double at(double value, const double* p) const override {
    const double x = std::clamp((2 * value - p[0] - p[1]) / (p[1] - p[0]), -1.0, 1.0);
    // Bonnet's recursion.
    double before = 1, now = x, sum = p[2] * x;
    for (int d = 2; d <= degree_; ++d) {
      before = std::exchange(now, ((2 * d - 1) * x * now - (d - 1) * before) / d);
      sum += p[d + 1] * now;
    }
    return sum;
  }

  int degree_;
};

/// Harmonics of order 1 … d of an angle.
class HarmonicSeries final : public FunctionOfDriver {
 public:
  HarmonicSeries(DriverPointer driver, Target target, int order)
      : FunctionOfDriver(std::move(driver), target), order_(order) {}

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos;
    for (int d = 1; d <= order_; ++d) {
      infos.push_back({"c" + std::to_string(d), target().unit(), ParameterRole::amplitude});
      infos.push_back({"s" + std::to_string(d), target().unit(), ParameterRole::amplitude});
    }
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return {{std::vector<double>(parameters().size(), target().typical_size())}};
  }

 private:
  std::string function() const override {
    return "harmonic series of order " + std::to_string(order_);
  }
  double at(double value, const double* p) const override {
    double sum = 0;
    for (int d = 1; d <= order_; ++d)
      sum += p[2 * d - 2] * std::cos(d * value) + p[2 * d - 1] * std::sin(d * value);
    return sum;
  }

  int order_;
};

/// One wave of unknown period over the range that was seen.
class Wave final : public FunctionOfDriver {
 public:
  /// Periods in the range: least, least + step … most; none shorter than `shortest`.
  Wave(DriverPointer driver, Target target, double least, double step, double most,
       double shortest = 0)
      : FunctionOfDriver(std::move(driver), target),
        least_(least),
        step_(step),
        most_(most),
        shortest_(shortest) {}

  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"start", "", ParameterRole::index},
            {"period", "", ParameterRole::shape},
            {"c", target().unit(), ParameterRole::amplitude},
            {"s", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    const double size = target().typical_size();
    std::vector<Hypothesis> starts;
    const auto steps = std::lround((most_ - least_) / step_);
    for (long k = 0; k <= steps; ++k) {
      const double period = (high - low) / (least_ + static_cast<double>(k) * step_);
      if (period >= shortest_) starts.push_back({{low, period, size, size}});
    }
    return starts;
  }

 private:
  std::string function() const override { return "wave"; }
  double at(double value, const double* p) const override {
    const double phase = 2 * std::numbers::pi * (value - p[0]) / p[1];
    return p[2] * std::cos(phase) + p[3] * std::sin(phase);
  }

  double least_, step_, most_, shortest_;
};

/// Something that happened once and took a while: a bell of unknown middle and width.
class Bell final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    return {{"middle", "", ParameterRole::shape},
            {"width", "", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double share : {1.0 / 60, 1.0 / 30, 1.0 / 15}) {
      const double width = share * (high - low);
      const auto steps = static_cast<long>((high - low) / (1.5 * width));
      for (long k = 0; k <= steps; ++k)
        starts.push_back(
            {{low + 1.5 * width * static_cast<double>(k), width, target().typical_size()}});
    }
    return starts;
  }

 private:
  std::string function() const override { return "bell"; }
  double at(double value, const double* p) const override {
    const double x = (value - p[0]) / p[1];
    return p[2] * std::exp(-0.5 * x * x);
  }
};

/// What a course over the dwell is multiplied with.
enum class CourseOf { one, component, step };

/// The same course in every dwell: polynomials of the logarithm of the time since arrival, without
/// their mean over the dwell.
class DwellCourse final : public SmoothTerm {
 public:
  DwellCourse(const VisitLog& log, CourseOf of, int degree) : of_(of), degree_(degree) {
    for (const auto& [count, contrasts] : log.contrasts) {
      Eigen::MatrixXd table(static_cast<Eigen::Index>(count), degree);
      for (Eigen::Index m = 0; m < table.rows(); ++m) {
        const double x = 2 * std::log1p(static_cast<double>(m)) /
                             std::log1p(std::max<double>(1, static_cast<double>(count) - 1)) -
                         1;
        for (int d = 1; d <= degree; ++d)
          table(m, d - 1) = std::legendre(static_cast<unsigned>(d), x);
      }
      table.rowwise() -= table.colwise().mean().eval();
      tables_.emplace(count, std::move(table));
    }
  }

  std::string id() const override { return "unlisted:t_in_pose:sample"; }
  const std::string& driver() const override { return driver_; }
  TermForm form() const override { return TermForm::sample; }
  std::string shape() const override {
    std::string words = "polynomial of degree " + std::to_string(degree_) +
                        " in the logarithm of the time since arrival";
    switch (of_) {
      case CourseOf::one:
        break;
      case CourseOf::component:
        return words + ", times a_i";
      case CourseOf::step:
        return words + ", times the change of a_i on the way";
    }
    return words;
  }
  Subject subject() const override { return Subject::sensor; }
  bool within_dwell() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos;
    for (int d = 1; d <= degree_; ++d)
      infos.push_back(
          {"p" + std::to_string(d), of_ == CourseOf::one ? "g" : "", ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // A course of higher degree than there are samples is no course.
    if (log.contrasts.begin()->first <= static_cast<std::size_t>(degree_)) return {};
    return {{std::vector<double>(parameters().size(), effect::kSmallTerm)}};
  }
  double term_g(const TermInput&, const double*) const override { return 0; }
  double sample_term_g(const TermInput& input, const double* p,
                       double since_arrival_s) const override {
    const Eigen::MatrixXd& table = tables_.at(input.at().count);
    const double step_s = input.at().step_s;
    const auto m = step_s > 0 ? std::lround(since_arrival_s / step_s) : 0;
    double sum = 0;
    for (int d = 0; d < degree_; ++d)
      sum += p[d] * table(std::clamp<Eigen::Index>(m, 0, table.rows() - 1), d);
    return sum * factor(input);
  }

 private:
  double factor(const TermInput& input) const {
    switch (of_) {
      case CourseOf::one:
        break;
      case CourseOf::component:
        return input.a();
      case CourseOf::step: {
        if (input.visit == 0) return 0;
        return input.a_g[input.visit - 1](static_cast<Eigen::Index>(input.axis)) - input.a();
      }
    }
    return 1;
  }

  CourseOf of_;
  int degree_;
  std::string driver_ = "t_in_pose";
  std::map<std::size_t, Eigen::MatrixXd> tables_;
};

/// Output voltage without noise stands for the converter's code.
Driver code_driver(const VisitLog& log, std::size_t axis) {
  Driver driver{std::string("code_") + kAxisName[axis], "", {}};
  for (const Visit& visit : log.visits)
    for (auto& values : driver.value) values.push_back(visit.mean_V[axis]);
  return driver;
}

}  // namespace

std::vector<std::unique_ptr<SmoothTerm>> smooth_terms(const VisitLog& log,
                                                      SmoothTermSelection selection) {
  const bool any = selection == SmoothTermSelection::any;
  std::vector<std::unique_ptr<SmoothTerm>> terms;
  const auto add_polynomials = [&](const DriverPointer& driver, const Target& target,
                                   std::initializer_list<int> degrees) {
    for (const int degree : degrees) {
      if (driver->angle) {
        terms.push_back(std::make_unique<HarmonicSeries>(driver, target, degree));
      } else {
        terms.push_back(std::make_unique<Polynomial>(driver, target, degree));
      }
    }
  };
  for (Driver& each : instantaneous_drivers(log)) {
    const auto driver = std::make_shared<const Driver>(std::move(each));
    if (!any && !driver->varies()) continue;  // a variable that never varied drives nothing
    add_polynomials(driver, {TermForm::bias}, {1, 2, 3, 5});
    add_polynomials(driver, {TermForm::scale}, {1, 2, 3, 5});
    add_polynomials(driver, {TermForm::geometry}, {1, 2, 3, 5});
    add_polynomials(driver, {TermForm::geometry, 0, true}, {1, 2, 3, 5});
    const bool clock = driver->name == "t_s";
    if (driver->recorded || clock) {
      add_polynomials(driver, {TermForm::scale, 1}, {1, 2});
      add_polynomials(driver, {TermForm::scale, 2}, {1, 2});
    }
    if (clock) {
      terms.push_back(std::make_unique<Bell>(driver, Target{TermForm::bias}));
      for (const Target& target : {Target{TermForm::bias}, Target{TermForm::scale},
                                   Target{TermForm::geometry}, Target{TermForm::geometry, 0, true}})
        terms.push_back(std::make_unique<Wave>(driver, target, 1.5, 0.5, 40));
    }
  }
  const double span_s = log.last_s() - log.first_s();
  const double step_s = span_s / std::max<double>(1, static_cast<double>(log.visits.size()) - 1);
  std::size_t index = 0;
  std::vector<Driver> remembered = remembered_drivers(log);
  const std::size_t per_tau = remembered.size() / std::size(kMemory_s);
  for (Driver& each : remembered) {
    const double tau_s = kMemory_s[index++ / per_tau];
    const auto driver = std::make_shared<const Driver>(std::move(each));
    if (!any && (tau_s < step_s || tau_s > span_s / 2 || !driver->varies())) continue;
    add_polynomials(driver, {TermForm::bias}, {1, 2});
    add_polynomials(driver, {TermForm::scale}, {1, 2});
  }
  // What repeats from step to step, or every second step, is the rounding itself, or a bit.
  constexpr double kShortestWave = 2.5;  // steps
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto driver = std::make_shared<const Driver>(code_driver(log, axis));
    if (any || driver->varies())
      terms.push_back(std::make_unique<Wave>(driver, Target{TermForm::bias}, 3, 0.5, 40,
                                             log.adc ? kShortestWave * log.adc->lsb_V() : 0));
  }
  for (const CourseOf of : {CourseOf::one, CourseOf::component, CourseOf::step})
    for (const int degree : {1, 2, 3})
      terms.push_back(std::make_unique<DwellCourse>(log, of, degree));
  return terms;
}

}  // namespace plumbline
