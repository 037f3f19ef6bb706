#include "estimator/effects/dwell_course.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace plumbline {
namespace {

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
  bool remembers() const override { return of_ == CourseOf::step; }
  bool guesses_at_start() const override { return remembers(); }
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
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    const Eigen::MatrixXd& table = tables_.at(input.at().count);
    return factor(input) * (table * Eigen::Map<const Eigen::VectorXd>(p, table.cols()));
  }

 private:
  double factor(const TermInput& input) const {
    switch (of_) {
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

  CourseOf of_;
  int degree_;
  std::string driver_ = "t_in_pose";
  std::map<std::size_t, Eigen::MatrixXd> tables_;
};

}  // namespace

std::unique_ptr<SmoothTerm> dwell_course(const VisitLog& log, CourseOf of, int degree) {
  return std::make_unique<DwellCourse>(log, of, degree);
}

}  // namespace plumbline
