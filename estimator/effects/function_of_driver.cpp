#include "estimator/effects/function_of_driver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "estimator/effects/driven_term.h"

namespace plumbline {
namespace {

/// Legendre polynomials of degree 1 … d over the range that was seen. Where the 12 parameters do
/// not hold its mean, there is one of degree 0: what is proportional to a temperature or to the
/// time is so from a zero outside the range, and what sags with h is so from a level spindle on.
/// Where they do, it is nothing at the driver's reference, and has no slope there (or at the end of
/// the range next to it) where they hold that, too: it is a power series without its first terms.
class Polynomial final : public DrivenTerm {
 public:
  Polynomial(DriverPointer driver, Target target, int degree)
      : DrivenTerm(std::move(driver), target), degree_(degree) {}

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"low", variable().unit(), ParameterRole::index},
                                        {"high", variable().unit(), ParameterRole::index}};
    for (int d = first_degree(); d <= degree_; ++d) {
      infos.push_back({"p" + std::to_string(d), target().unit(), ParameterRole::amplitude});
      // What is there all the time has a name.
      infos.back().needed = degree_ == 1 && first_degree() == 0 && d == 1;
    }
    if (has_reference()) infos.push_back({"ref", variable().unit(), ParameterRole::index});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    std::vector<double> p(parameters().size(), target().typical_size());
    std::tie(p[0], p[1]) = range();
    if (!(p[1] > p[0]) || !resolves(degree_)) return {};
    if (is_bias_in_disguise(axis)) return {};
    if (has_reference()) p.back() = *variable().reference;
    if (is_in_the_twelve()) {
      if (degree_ == 1) return {};
      p[2] = 0;
    }
    if (!is_of_h() || first_degree() > 0) return {{std::move(p)}};
    std::vector<double> without_mean = p;
    without_mean[2] = 0;
    return {{std::move(without_mean)}, {std::move(p)}};
  }

 private:
  std::string function() const override {
    return "polynomial of degree " + std::to_string(degree_);
  }
  double at(double value, const double* p) const override {
    // A law of nature goes on; what a run did in its course need not.
    const double curved = variable().is_clock() ? 0 : 1;
    const double* linear = p + 3 - first_degree();
    const auto series = [&](double x) {
      return legendre_series(x, p[0], p[1], linear, degree_, curved);
    };
    if (first_degree() == 0) return p[2] + series(value);
    if (!has_reference()) return series(value);
    const double reference = linear[degree_];
    if (!is_in_the_twelve()) return series(value) - series(reference);
    const double touched = std::clamp(reference, p[0], p[1]);
    const double slope = legendre_slope(touched, p[0], p[1], linear, degree_);
    return series(value) - series(touched) - slope * (value - touched);
  }
  bool has_reference() const { return variable().reference && target().mean_in_the_twelve(); }
  bool is_of_h() const { return variable().name == "h_deg"; }
  int first_degree() const {
    const bool may_be_offset = variable().recorded || variable().is_clock() || is_of_h();
    return may_be_offset && !target().mean_in_the_twelve() ? 0 : 1;
  }

  int degree_;
};

/// Without what is linear: a product of third order by itself.
class Square final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    if (is_bias_in_disguise(axis)) return {};
    return {{{target().typical_size()}}};
  }

 private:
  std::string function() const override { return "square"; }
  double at(double value, const double* p) const override { return p[0] * value * value; }
};

class HarmonicSeries final : public DrivenTerm {
 public:
  HarmonicSeries(DriverPointer driver, Target target, int order)
      : DrivenTerm(std::move(driver), target), order_(order) {}

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

class Harmonic final : public DrivenTerm {
 public:
  Harmonic(DriverPointer driver, Target target, int lowest)
      : DrivenTerm(std::move(driver), target), lowest_(lowest) {}

  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"n", "", ParameterRole::index},
            {"c", target().unit(), ParameterRole::amplitude},
            {"s", target().unit(), ParameterRole::amplitude}};
  }
  // Positions at equal distances do not tell n from their number less n.
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kHighest = 18;
    const int positions = effect::positions_of_a_turn(variable().value[0]);
    const double size = target().typical_size();
    std::vector<Hypothesis> starts;
    for (int n = lowest_; n <= kHighest && 2 * n <= positions; ++n)
      starts.push_back(effect::harmonic(n, positions, variable().value[0].front(), size));
    return starts;
  }

 private:
  std::string function() const override { return "harmonic"; }
  double at(double value, const double* p) const override {
    return p[1] * std::cos(p[0] * value) + p[2] * std::sin(p[0] * value);
  }

  int lowest_;
};

/// A wheel with n arms, say: what it does in one part of the turn it does in each, and mostly not
/// as a sine does.
class HarmonicsOfPart final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"n", "", ParameterRole::index}};
    for (int order = 1; order <= kOrders; ++order)
      for (const char* part : {"c", "s"})
        infos.push_back({part + std::to_string(order), target().unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const int most = highest();
    std::vector<Hypothesis> starts;
    for (int n = kFewestParts; 2 * n <= most; ++n) add_parts(n, most, starts);
    return starts;
  }
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& found) const override {
    std::vector<Hypothesis> starts;
    if (repeated.id() != "rig.delta_periodic" || found.size() < 2) return starts;
    const double n = std::min_element(found.begin(), found.end())->front();
    add_parts(static_cast<int>(n), highest(), starts);
    std::erase_if(starts, [&](const Hypothesis& start) {
      return !std::all_of(found.begin(), found.end(), [&](const std::vector<double>& harmonic) {
        const double order = harmonic.front() / n;
        return order == std::floor(order) && start.p[place_of(static_cast<int>(order))] != 0;
      });
    });
    return starts;
  }

 private:
  static constexpr int kFewestParts = 3;  // fewer are the first harmonics of the turn
  static constexpr int kHighest = 18;
  static constexpr int kOrders = kHighest / kFewestParts;

  std::string function() const override { return "harmonics of a part of the turn"; }
  double at(double value, const double* p) const override {
    double sum = 0;
    for (int order = 1; order <= kOrders; ++order) {
      const double phase = p[0] * order * value;
      const double* amplitude = p + place_of(order);
      sum += amplitude[0] * std::cos(phase) + amplitude[1] * std::sin(phase);
    }
    return sum;
  }
  /// Of the two amplitudes of an order among the parameters.
  static std::size_t place_of(int order) { return static_cast<std::size_t>(2 * order - 1); }
  /// Positions at equal distances do not show a harmonic with two of them a period or less.
  int highest() const {
    return std::min(kHighest, (effect::positions_of_a_turn(variable().value[0]) - 1) / 2);
  }
  /// The first few orders, or the first few that are odd: up and down alike.
  void add_parts(int n, int most, std::vector<Hypothesis>& starts) const {
    for (const int step : {1, 2}) {
      Hypothesis start{std::vector<double>(parameters().size(), 0)};
      start.p[0] = n;
      for (int order = 1; order <= kOrders && n * order <= most; order += step) {
        for (const std::size_t k : {0U, 1U}) start.p[place_of(order) + k] = target().typical_size();
        if (order > 1) starts.push_back(start);
      }
    }
  }
};

class Wave final : public DrivenTerm {
 public:
  Wave(DriverPointer driver, Target target, const Cycles& cycles, double shortest)
      : DrivenTerm(std::move(driver), target), cycles_(cycles), shortest_(shortest) {}

  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"start", variable().unit(), ParameterRole::index},
            {"period", variable().unit(), ParameterRole::shape},
            {"c", target().unit(), ParameterRole::amplitude},
            {"s", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    const double size = target().typical_size();
    std::vector<Hypothesis> starts;
    constexpr double kMostOfAnother = 8;
    const double most =
        is_of_another_axis(axis) ? std::min(kMostOfAnother, cycles_.most) : cycles_.most;
    const auto steps = std::lround((most - cycles_.least) / cycles_.step);
    for (long k = 0; k <= steps; ++k) {
      const double period = (high - low) / (cycles_.least + static_cast<double>(k) * cycles_.step);
      const bool is_seen = !variable().component || resolves(static_cast<int>(k) + 2);
      if (period >= shortest_ && is_seen) starts.push_back({{low, period, size, size}});
    }
    return starts;
  }

 private:
  std::string function() const override { return "wave"; }
  double at(double value, const double* p) const override {
    constexpr double kOnTheEdge = 0.99;
    if (p[1] < kOnTheEdge * shortest_) return 0;  // the fit would end at an alias of a longer one
    const double phase = 2 * std::numbers::pi * (value - p[0]) / p[1];
    return p[2] * std::cos(phase) + p[3] * std::sin(phase);
  }

  Cycles cycles_;
  double shortest_;
};

class DyingWave final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"start", "s", ParameterRole::index},
            {"period", "s", ParameterRole::shape},
            {"tau", "s", ParameterRole::shape},
            {"c", target().unit(), ParameterRole::amplitude},
            {"s", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    const double span_s = high - low, size = target().typical_size();
    std::vector<Hypothesis> starts;
    for (const double cycles : effect::geometric(2, 16, 14))
      for (const double share : {0.08, 0.25})
        starts.push_back({{low, span_s / cycles, share * span_s, size, size}});
    return starts;
  }

 private:
  std::string function() const override { return "wave that dies away"; }
  double at(double t_s, const double* p) const override {
    const double phase = 2 * std::numbers::pi * (t_s - p[0]) / p[1];
    return std::exp((p[0] - t_s) / p[2]) * (p[3] * std::cos(phase) + p[4] * std::sin(phase));
  }
};

class Decay final : public DrivenTerm {
 public:
  /// What hardly changes would stand for what is there all the time, where that has a name.
  Decay(DriverPointer clock, const Target& target, double longest_s)
      : DrivenTerm(std::move(clock), target),
        longest_s_(target.mean_in_the_twelve() ? std::numeric_limits<double>::infinity()
                                               : longest_s) {}

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
  double at(double t_s, const double* p) const override {
    return p[0] <= longest_s_ ? p[1] * std::exp(-t_s / p[0]) : 0;
  }

  double longest_s_;
};

/// What diffuses grows with the root of the time; other powers come out of the fit.
class Power final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"start", variable().unit(), ParameterRole::index},
                                        {"end", variable().unit(), ParameterRole::index},
                                        {"power", "", ParameterRole::shape},
                                        {"p", target().unit(), ParameterRole::amplitude}};
    add_mean(infos);
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const double high = range().second;
    std::vector<Hypothesis> starts;
    for (const double beginning : beginnings())
      for (const double power : {0.5, 2.0})
        if (high > beginning)
          add_with_mean({beginning, high, power, target().typical_size()}, starts);
    return starts;
  }

 private:
  std::string function() const override { return "power"; }
  double at(double value, const double* p) const override {
    const double share = (value - p[0]) / (p[1] - p[0]);
    return mean(p + 4) + (share > 0 && p[2] > 0 ? p[3] * std::pow(share, p[2]) : 0);
  }
};

/// What relaxes over many time constants alike, as most ageing does.
class Logarithm final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"start", variable().unit(), ParameterRole::index},
            {"tau", variable().unit(), ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double beginning : beginnings())
      for (const double share : {0.003, 0.03, 0.3})
        starts.push_back({{beginning, share * (high - low), target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "logarithm"; }
  double at(double value, const double* p) const override {
    return value > p[0] && p[1] > 0 ? p[2] * std::log1p((value - p[0]) / p[1]) : 0;
  }
};

}  // namespace

std::string Target::words() const {
  if (form == TermForm::geometry) {
    const char* const grows = pull == Pull::cosine_of_h ? ", times the cosine of h"
                              : pull == Pull::sine_of_h ? ", times the sine of h"
                                                        : "";
    const bool in_seat = angle == &HeadGeometry::seat_y_rad;
    const char* const to = in_seat         ? ", added to the turn of the triad in its seat"
                           : any_direction ? ", added to the tilt of the base"
                           : angle == &HeadGeometry::h_rad    ? ", added to h"
                           : angle == &HeadGeometry::roll_rad ? ", added to the base roll"
                           : angle == &HeadGeometry::skew_rad ? ", added to the skew of the spindle"
                           : angle == &HeadGeometry::lift     ? ", added to gravity"
                                                              : ", added to delta";
    return std::string(grows) + to;
  }
  static const char* const kComponent[] = {"its own component", "the component of the next axis",
                                           "the component of the axis after the next"};
  if (form != TermForm::scale || (other == 0 && !second)) return "";
  return std::string(", times ") + kComponent[other] +
         (second ? std::string(" and ") + kComponent[*second] : "");
}

bool Target::mean_in_the_twelve() const {
  if (form != TermForm::geometry) return !second;
  return angle == &HeadGeometry::delta_rad || angle == &HeadGeometry::seat_y_rad;
}

const char* Target::unit() const {
  return form == TermForm::geometry ? "deg" : form == TermForm::scale ? "" : "g";
}

double Target::typical_size() const {
  return form == TermForm::geometry ? effect::kSmallAngle_deg : effect::kSmallTerm;
}

ForceFactor Target::factor() const {
  return form == TermForm::scale ? ForceFactor{other, second} : ForceFactor{};
}

double Target::factor_at(const Visit& visit) const {
  switch (pull) {
    case Pull::none:
      break;
    case Pull::cosine_of_h:
      return std::cos(visit.h_rad);
    case Pull::sine_of_h:
      return std::sin(visit.h_rad);
  }
  return 1;
}

double legendre_series(double value, double low, double high, const double* c, int degree,
                       double curved) {
  constexpr int kContinued = 2;  // the end slope of a higher degree is too uncertain
  const double position = (2 * value - low - high) / (high - low);
  const double reach = degree == kContinued ? 1 + curved : 1;
  const double x = std::clamp(position, -reach, reach);
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

double legendre_slope(double value, double low, double high, const double* c, int degree) {
  const double x = (2 * value - low - high) / (high - low);
  double before = 1, now = x, slope_before = 0, slope = 1, sum = c[0];
  for (int d = 2; d <= degree; ++d) {
    slope_before = std::exchange(slope, slope_before + (2 * d - 1) * now);
    before = std::exchange(now, ((2 * d - 1) * x * now - (d - 1) * before) / d);
    sum += c[d - 1] * slope;
  }
  return 2 * sum / (high - low);
}

std::unique_ptr<SmoothTerm> polynomial(DriverPointer driver, const Target& target, int degree) {
  return std::make_unique<Polynomial>(std::move(driver), target, degree);
}
std::unique_ptr<SmoothTerm> square(DriverPointer driver, const Target& target) {
  return std::make_unique<Square>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> harmonic_series(DriverPointer driver, const Target& target, int order) {
  return std::make_unique<HarmonicSeries>(std::move(driver), target, order);
}
std::unique_ptr<SmoothTerm> harmonic(DriverPointer driver, const Target& target, int lowest) {
  return std::make_unique<Harmonic>(std::move(driver), target, lowest);
}
std::unique_ptr<SmoothTerm> harmonics_of_part(DriverPointer angle, const Target& target) {
  return std::make_unique<HarmonicsOfPart>(std::move(angle), target);
}
std::unique_ptr<SmoothTerm> wave(DriverPointer driver, const Target& target, const Cycles& cycles,
                                 double shortest) {
  return std::make_unique<Wave>(std::move(driver), target, cycles, shortest);
}
bool is_wave(const Effect& effect) { return dynamic_cast<const Wave*>(&effect) != nullptr; }
std::unique_ptr<SmoothTerm> dying_wave(DriverPointer clock, const Target& target) {
  return std::make_unique<DyingWave>(std::move(clock), target);
}
std::unique_ptr<SmoothTerm> decay(DriverPointer clock, const Target& target, double longest_s) {
  return std::make_unique<Decay>(std::move(clock), target, longest_s);
}
std::unique_ptr<SmoothTerm> power(DriverPointer driver, const Target& target) {
  return std::make_unique<Power>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> logarithm(DriverPointer driver, const Target& target) {
  return std::make_unique<Logarithm>(std::move(driver), target);
}

}  // namespace plumbline
