#include "estimator/effects/function_of_driver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

/// A function of one driver; the shape is the derived class's.
class FunctionOfDriver : public SmoothTerm {
 public:
  FunctionOfDriver(DriverPointer driver, Target target)
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
  bool remembers() const override { return !driver_->past.empty() || driver_->is_rate(); }
  void displace(const VisitLog&, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.*target_.angle += of_visit(0, visit, p) * effect::kRadPerDeg;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const double f = driver_->output_of == input.axis ? at(input.output_V, p)
                                                      : of_visit(input.axis, input.visit, p);
    return f * target_.factor(input);
  }

 protected:
  virtual std::string function() const = 0;
  /// The function at one value of the driver, for those that depend on nothing else.
  virtual double at(double, const double*) const { return 0; }
  virtual double of_visit(std::size_t axis, std::size_t visit, const double* p) const {
    return at(driver_->value[axis][visit], p);
  }

  /// A place in the range.
  ParameterInfo place(const char* name) const {
    const auto [low, high] = range();
    constexpr double kFine = 1e-3;
    return {name, variable().angle ? "rad" : "", ParameterRole::shape, kFine * (high - low), true};
  }
  const std::pair<double, double>& range() const { return range_; }
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

/// Legendre polynomials of degree 1 … d over the range that was seen. Where the 12 parameters do
/// not hold its mean, there is one of degree 0: what is proportional to a temperature or to the
/// time is so from a zero outside the range.
class Polynomial final : public FunctionOfDriver {
 public:
  Polynomial(DriverPointer driver, Target target, int degree)
      : FunctionOfDriver(std::move(driver), target), degree_(degree) {}

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"low", "", ParameterRole::index},
                                        {"high", "", ParameterRole::index}};
    for (int d = first_degree(); d <= degree_; ++d)
      infos.push_back({"p" + std::to_string(d), target().unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<double> p(parameters().size(), target().typical_size());
    std::tie(p[0], p[1]) = range();
    if (!(p[1] > p[0])) return {};
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
    const double constant = first_degree() == 0 ? p[2] : 0;
    return constant + legendre_series(value, p[0], p[1], p + 3 - first_degree(), degree_);
  }
  int first_degree() const {
    const bool clock_or_record = variable().recorded || variable().is_clock();
    const bool mean_in_the_twelve = target().form == TermForm::geometry
                                        ? target().angle == &HeadGeometry::delta_rad
                                        : !target().second;
    return clock_or_record && !mean_in_the_twelve ? 0 : 1;
  }

  int degree_;
};

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

class Wave final : public FunctionOfDriver {
 public:
  Wave(DriverPointer driver, Target target, const Cycles& cycles, double shortest)
      : FunctionOfDriver(std::move(driver), target), cycles_(cycles), shortest_(shortest) {}

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
    const auto steps = std::lround((cycles_.most - cycles_.least) / cycles_.step);
    for (long k = 0; k <= steps; ++k) {
      const double period = (high - low) / (cycles_.least + static_cast<double>(k) * cycles_.step);
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

  Cycles cycles_;
  double shortest_;
};

class Bell final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    const char* unit = variable().angle ? "rad" : "";
    return {place("middle"),
            {"width", unit, ParameterRole::shape},
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
    const double away = value - p[0];
    const double x = (variable().angle ? std::remainder(away, effect::kTurn_rad) : away) / p[1];
    return p[2] * std::exp(-0.5 * x * x);
  }
};

class Pulses final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    constexpr double kFine = 0.1;  // of an edge, so that some readings are in it
    const double fine = kFine * edge();
    return {{"edge", "s", ParameterRole::index},
            {"period", "s", ParameterRole::shape, fine},
            {"width", "s", ParameterRole::shape, fine},
            {"middle", "s", ParameterRole::shape, fine, true},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    constexpr int kMiddles = 4, kMostPulses = 8;
    std::vector<Hypothesis> starts;
    for (int pulses = 2; pulses <= kMostPulses; ++pulses) {
      const double period = (high - low) / pulses;
      for (int k = 0; k < kMiddles; ++k)
        starts.push_back(
            {{edge(), period, 0.5 * period, low + period * k / kMiddles, target().typical_size()}});
    }
    return starts;
  }
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& instances) const override {
    if (target().form != TermForm::bias) return {};
    if (repeated.id() == "sensor.bias_step") return from_steps(instances);
    return repeated.id() == id() ? from_waves(instances) : std::vector<Hypothesis>{};
  }

 private:
  std::string function() const override { return "train of pulses"; }
  double at(double value, const double* p) const override {
    const double from_middle = std::abs(std::remainder(value - p[3], p[1]));
    return p[4] / (1 + std::exp((from_middle - 0.5 * p[2]) / p[0]));
  }
  /// A part of the time from pose to pose, over which an edge is spread so that it can be moved.
  double edge() const {
    constexpr double kPart = 0.25;
    const auto [low, high] = range();
    return kPart * (high - low) / static_cast<double>(variable().value[0].size());
  }
  /// Two steps, a period apart, and one back.
  std::vector<Hypothesis> from_steps(const std::vector<std::vector<double>>& steps) const {
    if (steps.size() != 3) return {};
    const double size = steps[0][0], first_s = steps[0][1];
    const double width_s = steps[2][1] - first_s;
    return {{{edge(), steps[1][1] - first_s, width_s, first_s + 0.5 * width_s, size}}};
  }
  /// The longest of several waves is the fundamental.
  std::vector<Hypothesis> from_waves(const std::vector<std::vector<double>>& waves) const {
    if (waves.size() < 2) return {};  // one alone is a wave
    std::vector<double> longest;
    for (const auto& wave : waves) {
      if (wave.size() != 4) return {};  // another shape
      if (longest.empty() || wave[1] > longest[1]) longest = wave;
    }
    const double period = longest[1];
    const double crest =
        longest[0] + period * std::atan2(longest[3], longest[2]) / (2 * std::numbers::pi);
    std::vector<Hypothesis> found;
    for (const double share : {0.2, 0.35, 0.5, 0.65, 0.8})  // of a period
      found.push_back({{edge(), period, share * period, crest, target().typical_size()}});
    return found;
  }
};

class Bend final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", "", ParameterRole::index},
            {"high", "", ParameterRole::index},
            {"side", "", ParameterRole::index},
            place("at"),
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 8;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (int k = 1; k < kParts; ++k) {
      const double at = low + (high - low) * k / kParts;
      starts.push_back({{low, high, 1, at, target().typical_size()}});
      // The two sides differ by a straight line.
      if (!is_in_the_twelve()) starts.push_back({{low, high, -1, at, target().typical_size()}});
    }
    return starts;
  }

 private:
  std::string function() const override { return "bend"; }
  double at(double value, const double* p) const override {
    // A bend at the very end is none: it would follow the last readings, whatever they are.
    constexpr double kEnd = 0.08;
    const double end = kEnd * (p[1] - p[0]);
    if (p[3] < p[0] + end || p[3] > p[1] - end) return 0;
    return p[4] * std::max(0.0, p[2] * (value - p[3]));
  }
};

class Step final : public FunctionOfDriver {
 public:
  Step(DriverPointer driver, Target target, StepEdge edge)
      : FunctionOfDriver(std::move(driver), target), edge_(edge) {}

  std::vector<ParameterInfo> parameters() const override {
    // Hardly a reading lies in the edge of a sharp step: its width is not differentiated.
    const auto width = edge_ == StepEdge::sharp ? ParameterRole::index : ParameterRole::shape;
    return {place("at"), {"width", "", width}, {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 12;
    const auto [low, high] = range();
    const std::vector<double> shares =
        edge_ == StepEdge::sharp ? std::vector{0.01} : std::vector{0.04, 0.13};
    std::vector<Hypothesis> starts;
    for (const double share : shares)
      for (int k = 1; k < kParts; ++k)
        starts.push_back(
            {{low + (high - low) * k / kParts, share * (high - low), target().typical_size()}});
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    if (edge_ == StepEdge::gradual) return others;
    for (const double ratio : {0.25, 0.35, 0.5, 0.7, 1.4, 2.0, 2.8, 4.0})
      others.push_back({{found.p[0], ratio * found.p[1], found.p[2]}});
    // Between two readings nothing moves a sharp step: it is tried at every place.
    constexpr double kSharp = 0.08;
    constexpr int kPlaces = 8;  // on either side
    for (int place = -kPlaces; place <= kPlaces; ++place)
      others.push_back({{found.p[0] + 0.25 * place * found.p[1], kSharp * found.p[1], found.p[2]}});
    return others;
  }

 private:
  std::string function() const override { return "step"; }
  double at(double value, const double* p) const override {
    return p[2] / (1 + std::exp((p[0] - value) / p[1]));
  }

  StepEdge edge_;
};

class Decay final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    return {{"tau", "s", ParameterRole::shape}, {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const double span_s = range().second - range().first;
    std::vector<Hypothesis> starts;
    for (const double tau_s : effect::geometric(span_s / 30, span_s / 2, 5))
      starts.push_back({{tau_s, target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "exponential"; }
  double at(double t_s, const double* p) const override { return p[1] * std::exp(-t_s / p[0]); }
};

/// What diffuses grows with the root of the time; other powers come out of the fit.
class Power final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    return {{"start", "", ParameterRole::index},
            {"end", "", ParameterRole::index},
            {"power", "", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double power : {0.5, 2.0})
      starts.push_back({{low, high, power, target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "power"; }
  double at(double value, const double* p) const override {
    const double share = (value - p[0]) / (p[1] - p[0]);
    return share > 0 && p[2] > 0 ? p[3] * std::pow(share, p[2]) : 0;
  }
};

/// What relaxes over many time constants alike, as most ageing does.
class Logarithm final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  std::vector<ParameterInfo> parameters() const override {
    return {{"start", "", ParameterRole::index},
            {"tau", "", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double share : {0.003, 0.03, 0.3})
      starts.push_back({{low, share * (high - low), target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "logarithm"; }
  double at(double value, const double* p) const override {
    return value > p[0] && p[1] > 0 ? p[2] * std::log1p((value - p[0]) / p[1]) : 0;
  }
};

class PlayLag final : public FunctionOfDriver {
 public:
  using FunctionOfDriver::FunctionOfDriver;

  bool remembers() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"width", "", ParameterRole::shape}, {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double share : effect::geometric(0.01, 0.64, 7))
      if (goes_to_and_fro(axis, share * (high - low)))
        starts.push_back({{share * (high - low), target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "lag behind a play"; }
  /// Drawn along in one direction only, the lag is a function of the driver itself.
  bool goes_to_and_fro(std::size_t axis, double width) const {
    const std::vector<double>& driver = variable().value[axis];
    const double half = 0.5 * width;
    bool up = false, down = false;
    double follower = driver.front();
    for (const double value : driver) {
      up |= value - half > follower;
      down |= value + half < follower;
      follower = std::clamp(follower, value - half, value + half);
    }
    return up && down;
  }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const std::vector<double>& driver = variable().value[axis];
    const double half = 0.5 * std::abs(p[0]);
    double follower = driver.front();
    for (std::size_t k = 0; k <= visit; ++k)
      follower = std::clamp(follower, driver[k] - half, driver[k] + half);
    return p[1] * (follower - driver[visit]);
  }
};

}  // namespace

std::string Target::words() const {
  if (form == TermForm::geometry) {
    if (angle == &HeadGeometry::h_rad) return ", added to h";
    if (angle == &HeadGeometry::roll_rad) return ", added to the base roll";
    if (angle == &HeadGeometry::skew_rad) return ", added to the skew of the spindle";
    return ", added to delta";
  }
  static const char* const kComponent[] = {"its own component", "the component of the next axis",
                                           "the component of the axis after the next"};
  if (form != TermForm::scale || (other == 0 && !second)) return "";
  return std::string(", times ") + kComponent[other] +
         (second ? std::string(" and ") + kComponent[*second] : "");
}

const char* Target::unit() const {
  return form == TermForm::geometry ? "deg" : form == TermForm::scale ? "" : "g";
}

double Target::typical_size() const {
  return form == TermForm::geometry ? effect::kSmallAngle_deg : effect::kSmallTerm;
}

double Target::factor(const TermInput& input) const {
  const auto component_g = [&](std::size_t next) {
    return input.a_g[input.visit](static_cast<Eigen::Index>((input.axis + next) % kAxisCount));
  };
  if (form != TermForm::scale) return 1;
  return component_g(other) * (second ? component_g(*second) : 1);
}

double legendre_series(double value, double low, double high, const double* c, int degree) {
  constexpr int kContinued = 2;  // the end slope of a higher degree is too uncertain
  const double position = (2 * value - low - high) / (high - low);
  const double x = std::clamp(position, -1.0, 1.0);
  // Bonnet's recursion.
  double before = 1, now = x, sum = c[0] * x;
  for (int d = 2; d <= degree; ++d) {
    before = std::exchange(now, ((2 * d - 1) * x * now - (d - 1) * before) / d);
    sum += c[d - 1] * now;
  }
  if (position == x || degree > kContinued) return sum;
  const double end_slope = c[0] + (degree == 2 ? 3 * x * c[1] : 0);
  return sum + end_slope * (position - x);
}

std::unique_ptr<SmoothTerm> polynomial(DriverPointer driver, const Target& target, int degree) {
  return std::make_unique<Polynomial>(std::move(driver), target, degree);
}
std::unique_ptr<SmoothTerm> harmonic_series(DriverPointer driver, const Target& target, int order) {
  return std::make_unique<HarmonicSeries>(std::move(driver), target, order);
}
std::unique_ptr<SmoothTerm> wave(DriverPointer driver, const Target& target, const Cycles& cycles,
                                 double shortest) {
  return std::make_unique<Wave>(std::move(driver), target, cycles, shortest);
}
std::unique_ptr<SmoothTerm> bell(DriverPointer driver, const Target& target) {
  return std::make_unique<Bell>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> pulses(DriverPointer driver, const Target& target) {
  return std::make_unique<Pulses>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> bend(DriverPointer driver, const Target& target) {
  return std::make_unique<Bend>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> step(DriverPointer driver, const Target& target, StepEdge edge) {
  return std::make_unique<Step>(std::move(driver), target, edge);
}
std::unique_ptr<SmoothTerm> decay(DriverPointer clock, const Target& target) {
  return std::make_unique<Decay>(std::move(clock), target);
}
std::unique_ptr<SmoothTerm> power(DriverPointer driver, const Target& target) {
  return std::make_unique<Power>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> logarithm(DriverPointer driver, const Target& target) {
  return std::make_unique<Logarithm>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> play(DriverPointer driver, const Target& target) {
  return std::make_unique<PlayLag>(std::move(driver), target);
}

}  // namespace plumbline
