#include "estimator/effects/steady_line.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "estimator/effects/head_in_dwell.h"

namespace plumbline {
namespace {

class SwingingAngle final : public HeadInDwell {
 public:
  using HeadInDwell::HeadInDwell;

  std::vector<ParameterInfo> parameters() const override {
    return {{"amplitude", is_lift() ? "g" : "deg", ParameterRole::amplitude},
            effect::line_frequency(),
            effect::line_phase()};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const auto at = std::find(kSwinging.begin(), kSwinging.end(), angle());
    const auto& line = log.swinging_line.at(static_cast<std::size_t>(at - kSwinging.begin()));
    if (!line || !line->steady) return {};
    const double small = is_lift() ? effect::kSmallTerm : effect::kSmallAngle_deg;
    return {{{small, line->f_hz, effect::start_of_phase_deg(*line)}}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.*angle() += p[0] * per_unit(log) * effect::mean_of_sine(log.visits[visit], p[1], p[2]);
  }
  AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const override {
    return {angle(), p[0] * per_unit(log) * effect::sine(log.visits[visit], p[1], p[2])};
  }
  void normalise(std::vector<double>& p) const override { effect::normalise_sine(p[0], p[2]); }

 private:
  std::string function() const override { return "sine"; }
  bool is_lift() const { return angle() == &HeadGeometry::lift; }
  double per_unit(const VisitLog& log) const { return is_lift() ? 1 / log.gamma : kRadPerDeg; }
};

class LineOfDriver final : public SmoothTerm {
 public:
  LineOfDriver(DriverPointer driver, StrengthBy by) : driver_(std::move(driver)), by_(by) {}

  std::string id() const override { return "unlisted:" + driver_->name + ":sample"; }
  const std::string& driver() const override { return driver_->name; }
  TermForm form() const override { return TermForm::sample; }
  std::string shape() const override {
    switch (by_) {
      case StrengthBy::size:
        return "straight line, times a sine in its size";
      case StrengthBy::square:
        return "parabola, times a sine";
      case StrengthBy::value:
        break;
    }
    return "straight line, times a sine";
  }
  Subject subject() const override { return Subject::sensor; }
  bool within_dwell() const override { return true; }
  std::vector<std::string> columns() const override { return driver_->columns(); }
  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"low", driver_->unit(), ParameterRole::index},
                                        {"high", driver_->unit(), ParameterRole::index},
                                        effect::line_frequency(),
                                        effect::line_phase(),
                                        {"p0", "g", ParameterRole::amplitude},
                                        {"p1", "g", ParameterRole::amplitude}};
    if (by_ == StrengthBy::square) infos.push_back({"p2", "g", ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    const auto& line = log.line[axis];
    const std::vector<double>& value = driver_->value[axis];
    auto [low, high] = std::pair(*std::min_element(value.begin(), value.end()),
                                 *std::max_element(value.begin(), value.end()));
    if (!line || !line->steady || !(high > low)) return {};
    if (by_ == StrengthBy::square && driver_->fewest_values < 3) return {};
    if (by_ == StrengthBy::size) {
      if (!(low < 0 && high > 0)) return {};  // of one sign it is a straight line
      high = std::max(-low, high);
      low = 0;
    }
    std::vector<double> p(parameters().size(), effect::kSmallTerm);
    p[0] = low;
    p[1] = high;
    p[2] = line->f_hz;
    p[3] = effect::start_of_phase_deg(*line);
    return {{std::move(p)}};
  }
  double term_g(const TermInput& input, const double* p) const override {
    return size_g(input, p) * effect::mean_of_sine(input.at(), p[2], p[3]);
  }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return size_g(input, p) * effect::sine(input.at(), p[2], p[3]);
  }

 private:
  double size_g(const TermInput& input, const double* p) const {
    const double of_driver = driver_->value[input.axis][input.visit];
    const double value = by_ == StrengthBy::size ? std::abs(of_driver) : of_driver;
    const double x = (2 * value - p[0] - p[1]) / (p[1] - p[0]);
    return p[4] + p[5] * x + (by_ == StrengthBy::square ? p[6] * (1.5 * x * x - 0.5) : 0);
  }

  DriverPointer driver_;
  StrengthBy by_;
};

}  // namespace

std::unique_ptr<SmoothTerm> swinging_angle(double HeadGeometry::*angle) {
  return std::make_unique<SwingingAngle>(angle);
}
std::unique_ptr<SmoothTerm> line_of_driver(DriverPointer driver, StrengthBy by) {
  return std::make_unique<LineOfDriver>(std::move(driver), by);
}

}  // namespace plumbline
