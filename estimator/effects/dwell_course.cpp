#include "estimator/effects/dwell_course.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <utility>

namespace plumbline {
namespace {

/// What a course is multiplied with at a visit.
double factor_of(CourseOf of, const TermInput& input) {
  switch (of) {
    case CourseOf::one:
      break;
    case CourseOf::component:
      return input.a();
    case CourseOf::step: {
      if (input.log.before(input.visit) == nullptr) return 0;
      return input.a_g[input.visit - 1](static_cast<Eigen::Index>(input.axis)) - input.a();
    }
  }
  return 1;
}
const char* words_of(CourseOf of) {
  switch (of) {
    case CourseOf::one:
      break;
    case CourseOf::component:
      return ", times a_i";
    case CourseOf::step:
      return ", times the change of a_i on the way";
  }
  return "";
}

/// What courses over the dwell have in common.
class WithinDwell : public SmoothTerm {
 public:
  explicit WithinDwell(CourseOf of) : of_(of) {}

  std::string id() const override { return "unlisted:t_in_pose:sample"; }
  const std::string& driver() const override { return driver_; }
  TermForm form() const override { return TermForm::sample; }
  Subject subject() const override { return Subject::sensor; }
  bool remembers() const override { return of_ == CourseOf::step; }
  bool guesses_at_start() const override { return remembers(); }
  bool within_dwell() const override { return true; }

 protected:
  const char* unit() const { return of_ == CourseOf::one ? "g" : ""; }
  CourseOf of() const { return of_; }

 private:
  CourseOf of_;
  std::string driver_ = "t_in_pose";
};

class DwellCourse final : public WithinDwell {
 public:
  DwellCourse(const VisitLog& log, CourseOf of, int degree) : WithinDwell(of), degree_(degree) {
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

  std::string shape() const override {
    return "polynomial of degree " + std::to_string(degree_) +
           " in the logarithm of the time since arrival" + words_of(of());
  }
  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos;
    for (int d = 1; d <= degree_; ++d)
      infos.push_back({"p" + std::to_string(d), unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    // A course of higher degree than there are samples is no course.
    if (log.contrasts.begin()->first <= static_cast<std::size_t>(degree_)) return {};
    return {{std::vector<double>(parameters().size(), effect::kSmallTerm)}};
  }
  double term_g(const TermInput&, const double*) const override { return 0; }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    const Eigen::MatrixXd& table = tables_.at(input.at().count);
    return factor_of(of(), input) * (table * Eigen::Map<const Eigen::VectorXd>(p, table.cols()));
  }

 private:
  int degree_;
  std::map<std::size_t, Eigen::MatrixXd> tables_;
};

class RingDown final : public WithinDwell {
 public:
  using WithinDwell::WithinDwell;

  std::string shape() const override {
    return std::string("ringing that dies away") + words_of(of());
  }
  std::vector<ParameterInfo> parameters() const override {
    return {{"f", "Hz", ParameterRole::shape},
            {"tau", "s", ParameterRole::shape},
            {"c", unit(), ParameterRole::amplitude},
            {"s", unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    constexpr double kLeastPeriods = 1, kMostOfRate = 0.4;
    constexpr std::size_t kFewestSamples = 16;
    const Visit& visit = log.visits.front();
    const double dwell_s = visit.duration_s();
    std::vector<Hypothesis> starts;
    if (!(dwell_s > 0) || visit.count < kFewestSamples) return starts;
    for (const double f_hz :
         effect::geometric(kLeastPeriods / dwell_s, kMostOfRate / visit.step_s, 8))
      for (const double part : {0.1, 0.4})
        starts.push_back({{f_hz, part * dwell_s, effect::kSmallTerm, effect::kSmallTerm}});
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const Visit& visit = input.at();
    const std::complex<double> turn = turn_of_sample(visit, p);
    const auto n = static_cast<double>(visit.count);
    const std::complex<double> mean = (1.0 - std::pow(turn, n)) / (1.0 - turn) / n;
    return factor_of(of(), input) * (p[2] * mean.real() + p[3] * mean.imag());
  }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return factor_of(of(), input) * course(input.at(), p);
  }

 private:
  static std::complex<double> turn_of_sample(const Visit& visit, const double* p) {
    return std::exp(visit.step_s * std::complex<double>(-1 / p[1], effect::kTurn_rad * p[0]));
  }
  static Eigen::VectorXd course(const Visit& visit, const double* p) {
    const std::complex<double> turn = turn_of_sample(visit, p);
    std::complex<double> now = 1;
    Eigen::VectorXd values(static_cast<Eigen::Index>(visit.count));
    for (double& value : values) {
      value = p[2] * now.real() + p[3] * now.imag();
      now *= turn;
    }
    return values;
  }
};

/// Nothing moves an edge between two samples.
class EventOfDwells final : public WithinDwell {
 public:
  explicit EventOfDwells(EventShape shape) : WithinDwell(CourseOf::one), shape_(shape) {}

  std::string shape() const override { return is_step() ? "step" : "window"; }
  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"from", "s", ParameterRole::index}};
    if (!is_step()) infos.push_back({"to", "s", ParameterRole::index});
    infos.push_back({"p", unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<Hypothesis> starts;
    const Visit& visit = log.visits.front();
    const auto before_s = [&](std::size_t sample) {
      return (static_cast<double>(sample) - 0.5) * visit.step_s;
    };
    if (const auto& event = log.event[axis]; event && event->lasts == is_step()) {
      starts.push_back({{before_s(event->from), effect::kSmallTerm}});
      if (!is_step()) starts.back().p.insert(starts.back().p.begin() + 1, before_s(event->to));
    }
    for (std::size_t from = visit.count / 2; is_step() && from > 0; from /= 2)
      starts.push_back({{before_s(from), effect::kSmallTerm}});
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    return course_g(input, p).mean();
  }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    const Eigen::ArrayXd t_s = effect::since_arrival_s(input.at());
    if (is_step()) return p[1] * (t_s > p[0]).cast<double>().matrix();
    return p[2] * (t_s > p[0] && t_s < p[1]).cast<double>().matrix();
  }

 private:
  bool is_step() const { return shape_ == EventShape::step; }

  EventShape shape_;
};

}  // namespace

std::unique_ptr<SmoothTerm> event_of_dwells(EventShape shape) {
  return std::make_unique<EventOfDwells>(shape);
}

std::unique_ptr<SmoothTerm> ring_down(CourseOf of) { return std::make_unique<RingDown>(of); }

std::unique_ptr<SmoothTerm> dwell_course(const VisitLog& log, CourseOf of, int degree) {
  return std::make_unique<DwellCourse>(log, of, degree);
}

}  // namespace plumbline
