#include "estimator/effects/dwell_course.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace plumbline {
namespace {

/// What a course is multiplied with at a visit.
double factor_of(CourseOf of, const TermInput& input) {
  const Visit* before = input.log.before(input.visit);
  const auto step_g = [&](std::size_t next) {
    const auto axis = static_cast<Eigen::Index>((input.axis + next) % kAxisCount);
    return before == nullptr ? 0 : input.a_g[input.visit - 1](axis) - input.a_g[input.visit](axis);
  };
  switch (of) {
    case CourseOf::one:
      break;
    case CourseOf::component:
      return input.a();
    case CourseOf::step:
      return step_g(0);
    case CourseOf::step_of_next:
      return step_g(1);
    case CourseOf::step_after_next:
      return step_g(2);
    case CourseOf::turn_of_delta:
      return before == nullptr ? 0 : std::abs(shorter_turn_rad(*before, input.at()));
    case CourseOf::turn_of_h:
      return before == nullptr ? 0 : std::abs(input.at().h_rad - before->h_rad);
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
    case CourseOf::step_of_next:
      return ", times the change of the component of the next axis on the way";
    case CourseOf::step_after_next:
      return ", times the change of the component of the axis after the next on the way";
    case CourseOf::turn_of_delta:
      return ", times the turn of delta on the way";
    case CourseOf::turn_of_h:
      return ", times the change of h on the way";
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
  bool remembers() const override { return of_ != CourseOf::one && of_ != CourseOf::component; }
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
    std::vector<Hypothesis> starts = effect::starts_of_ringing(log.visits.front());
    for (Hypothesis& start : starts) start.p[2] = start.p[3] = effect::kSmallTerm;
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    return factor_of(of(), input) * effect::mean_of_ringing(input.at(), p);
  }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return factor_of(of(), input) * effect::ringing(input.at(), p);
  }
};

class DecayInDwell final : public WithinDwell {
 public:
  using WithinDwell::WithinDwell;

  std::string shape() const override {
    return std::string("exponential after arrival") + words_of(of());
  }
  std::vector<ParameterInfo> parameters() const override {
    return {{"tau", "s", ParameterRole::shape}, {"c", unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const double dwell_s = log.visits.front().duration_s();
    std::vector<Hypothesis> starts;
    if (!(dwell_s > 0)) return starts;
    for (const double tau_s : effect::geometric(dwell_s / 10, dwell_s * 2, 5))
      starts.push_back({{tau_s, effect::kSmallTerm}});
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const Visit& visit = input.at();
    return factor_of(of(), input) * p[1] * effect::mean_decay(visit, visit.t_arrival_s, p[0]);
  }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    return factor_of(of(), input) * p[1] * effect::decay_since_arrival(input.at(), p[0]).matrix();
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

std::unique_ptr<SmoothTerm> decay_in_dwell(CourseOf of) {
  return std::make_unique<DecayInDwell>(of);
}

std::unique_ptr<SmoothTerm> dwell_course(const VisitLog& log, CourseOf of, int degree) {
  return std::make_unique<DwellCourse>(log, of, degree);
}

}  // namespace plumbline
