#include "estimator/effects/smooth_term.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace plumbline {

const char* to_string(TermForm form) {
  switch (form) {
    case TermForm::bias:
      return "bias";
    case TermForm::scale:
      return "scale";
    case TermForm::geometry:
      break;
  }
  return "geometry";
}

namespace {

/// A variable as a function of the visit (and of the axis, for "where this axis was before").
struct Driver {
  std::string name;
  std::function<double(const VisitLog&, std::size_t visit, std::size_t axis)> value;
  bool angle = false;  ///< periodic in 2π
};

double column_value(const VisitLog& log, std::size_t visit, std::ptrdiff_t column) {
  return column < 0 ? log.visits[visit].temperature_K
                    : log.visits[visit].covariate[static_cast<std::size_t>(column)];
}

// Slope between the neighbours of a visit, per hour.
double column_rate(const VisitLog& log, std::size_t visit, std::ptrdiff_t column) {
  const std::size_t before = visit == 0 ? 0 : visit - 1;
  const std::size_t after = std::min(visit + 1, log.visits.size() - 1);
  const double span_s = log.visits[after].t_mean_s - log.visits[before].t_mean_s;
  if (!(span_s > 0)) return 0;
  return 3600 * (column_value(log, after, column) - column_value(log, before, column)) / span_s;
}

Eigen::Vector3d nominal_g(const VisitLog& log, std::size_t visit) {
  return specific_force_g({log.visits[visit].delta_rad, log.visits[visit].h_rad}, log.gamma);
}

std::vector<Driver> drivers_of(const VisitLog& log) {
  std::vector<Driver> drivers;
  drivers.push_back(
      {"t_s", [](const VisitLog& l, std::size_t k, std::size_t) { return l.visits[k].t_mean_s; }});
  drivers.push_back(
      {"delta_deg",
       [](const VisitLog& l, std::size_t k, std::size_t) { return l.visits[k].delta_rad; }, true});
  drivers.push_back(
      {"h_deg", [](const VisitLog& l, std::size_t k, std::size_t) { return l.visits[k].h_rad; }});
  constexpr const char* kComponent[] = {"a_x", "a_y", "a_z"};
  for (Eigen::Index j = 0; j < 3; ++j) {
    drivers.push_back({kComponent[j], [j](const VisitLog& l, std::size_t k, std::size_t) {
                         return nominal_g(l, k)(j);
                       }});
  }
  drivers.push_back({"previous_pose", [](const VisitLog& l, std::size_t k, std::size_t axis) {
                       return nominal_g(l, k == 0 ? 0 : k - 1)(static_cast<Eigen::Index>(axis));
                     }});
  const auto add_column = [&](const std::string& name, std::ptrdiff_t column) {
    drivers.push_back({name, [column](const VisitLog& l, std::size_t k, std::size_t) {
                         return column_value(l, k, column);
                       }});
    drivers.push_back({name + ".rate", [column](const VisitLog& l, std::size_t k, std::size_t) {
                         return column_rate(l, k, column);
                       }});
  };
  if (log.has_temperature) add_column("temp_C", -1);
  for (std::size_t c = 0; c < log.covariate_names.size(); ++c) {
    add_column(log.covariate_names[c], static_cast<std::ptrdiff_t>(c));
  }
  return drivers;
}

// Smallest and largest value over all visits and axes.
std::pair<double, double> range(const Driver& driver, const VisitLog& log) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t k = 0; k < log.visits.size(); ++k) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      low = std::min(low, driver.value(log, k, i));
      high = std::max(high, driver.value(log, k, i));
    }
  }
  return {low, high};
}

class SmoothFunction final : public SmoothTerm {
 public:
  SmoothFunction(Driver driver, TermForm form, bool of_tilt, int degree)
      : driver_(std::move(driver)), form_(form), of_tilt_(of_tilt), degree_(degree) {}

  std::string id() const override {
    return "unlisted:" + driver_.name + ":" + to_string(form_) +
           (form_ == TermForm::geometry ? (of_tilt_ ? ":h" : ":delta") : "");
  }
  const std::string& driver() const override { return driver_.name; }
  TermForm form() const override { return form_; }
  std::string shape() const override {
    const std::string what = driver_.angle ? "harmonic series of order " : "polynomial of degree ";
    const std::string where =
        form_ == TermForm::geometry ? (of_tilt_ ? ", added to h" : ", added to delta") : "";
    return what + std::to_string(degree_) + where;
  }
  Subject subject() const override {
    return form_ == TermForm::geometry ? Subject::head : Subject::sensor;
  }
  std::vector<ParameterInfo> parameters() const override {
    const std::string unit = form_ == TermForm::geometry ? "deg"
                             : form_ == TermForm::scale  ? ""
                                                         : "g";
    std::vector<ParameterInfo> infos = {{"low", "", ParameterRole::index},
                                        {"high", "", ParameterRole::index}};
    for (int d = 1; d <= degree_; ++d) {
      const std::string order = std::to_string(d);
      if (driver_.angle) {
        infos.push_back({"c" + order, unit, ParameterRole::amplitude});
        infos.push_back({"s" + order, unit, ParameterRole::amplitude});
      } else {
        infos.push_back({"p" + order, unit, ParameterRole::amplitude});
      }
    }
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const auto [low, high] = range(driver_, log);
    const double size = form_ == TermForm::geometry ? effect::kSmallAngle_deg : effect::kSmallTerm;
    std::vector<double> p(parameters().size(), size);
    p[0] = low;
    p[1] = high;
    return {{std::move(p)}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    (of_tilt_ ? head.h_rad : head.delta_rad) += value(log, visit, 0, p) * effect::kRadPerDeg;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double f = value(input.log, input.visit, input.axis, p);
    return form_ == TermForm::scale ? f * input.a() : f;
  }

 private:
  double value(const VisitLog& log, std::size_t visit, std::size_t axis, const double* p) const {
    const double v = driver_.value(log, visit, axis);
    double sum = 0;
    if (driver_.angle) {
      for (int d = 1; d <= degree_; ++d) {
        sum += p[2 * d] * std::cos(d * v) + p[2 * d + 1] * std::sin(d * v);
      }
      return sum;
    }
    const double x = std::clamp((2 * v - p[0] - p[1]) / (p[1] - p[0]), -1.0, 1.0);
    for (int d = 1; d <= degree_; ++d) {
      sum += p[d + 1] * std::legendre(static_cast<unsigned>(d), x);
    }
    return sum;
  }

  Driver driver_;
  TermForm form_;
  bool of_tilt_;
  int degree_;
};

}  // namespace

std::vector<std::unique_ptr<SmoothTerm>> smooth_terms(const VisitLog& log) {
  std::vector<std::unique_ptr<SmoothTerm>> terms;
  for (const Driver& driver : drivers_of(log)) {
    const auto [low, high] = range(driver, log);
    if (!(high > low)) continue;  // a variable that never varied drives nothing
    for (int degree : {1, 2, 3, 5}) {
      const auto add = [&](TermForm form, bool of_tilt) {
        terms.push_back(std::make_unique<SmoothFunction>(driver, form, of_tilt, degree));
      };
      add(TermForm::bias, false);
      add(TermForm::scale, false);
      add(TermForm::geometry, false);
      add(TermForm::geometry, true);
    }
  }
  return terms;
}

}  // namespace plumbline
