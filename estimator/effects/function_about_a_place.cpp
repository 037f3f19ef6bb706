// Functions of a driver that are something about one place and nothing elsewhere.
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <map>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "estimator/effects/driven_term.h"

namespace plumbline {
namespace {

/// Something at one of the positions that an angle takes, and nowhere else: a damaged division.
class OnePosition final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {{"at", variable().unit(), ParameterRole::index},
            {"width", variable().unit(), ParameterRole::index},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  /// Positions that are visited several times: what happened once is no property of a place.
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kFewestVisits = 3;
    std::map<double, int> visits;
    for (const double value : variable().value[0]) ++visits[value];
    std::vector<double> places;
    double width = effect::kTurn_rad;
    for (auto place = visits.begin(); place != visits.end(); ++place) {
      if (place != visits.begin()) width = std::min(width, place->first - std::prev(place)->first);
      if (place->second >= kFewestVisits) places.push_back(place->first);
    }
    std::vector<Hypothesis> starts;
    if (places.size() < 3) return starts;
    for (const double at : places) starts.push_back({{at, 0.5 * width, target().typical_size()}});
    return starts;
  }

 private:
  std::string function() const override { return "one position"; }
  double at(double value, const double* p) const override {
    return std::abs(std::remainder(value - p[0], effect::kTurn_rad)) < 0.5 * p[1] ? p[2] : 0;
  }
};

/// Something of unknown middle and width.
class AboutAPlace : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {place("middle"),
            {"width", variable().unit(), ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }

 protected:
  /// Everywhere from one end of the range to the other, with widths as shares of it.
  std::vector<Hypothesis> everywhere(int places, std::initializer_list<double> shares) const {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (int k = 0; k <= places; ++k)
      for (const double share : shares)
        starts.push_back(
            {{low + (high - low) * k / places, share * (high - low), target().typical_size()}});
    return starts;
  }
};

class Bell final : public AboutAPlace {
 public:
  using AboutAPlace::AboutAPlace;

  std::vector<ParameterInfo> parameters() const override {
    const std::string unit = variable().unit();
    if (is_sparse())
      return {{"middle", unit, ParameterRole::index},
              {"width", unit, ParameterRole::index},
              {"p", target().unit(), ParameterRole::amplitude}};
    return AboutAPlace::parameters();
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    if (is_sparse()) {
      const std::vector<double> places = values_seen();
      for (std::size_t k = 0; k < places.size(); ++k)
        for (const double share : {0.4, 0.8, 1.6}) {
          const auto add = [&](double middle) {
            starts.push_back({{middle, share * spacing(), target().typical_size()}});
          };
          add(places[k]);
          // One that is seen at two of them at least.
          if (share > 0.5 && k + 1 < places.size()) add(0.5 * (places[k] + places[k + 1]));
        }
      return starts;
    }
    for (const double share : {1.0 / 60, 1.0 / 30, 1.0 / 15}) {
      const double width = share * (high - low);
      const auto steps = static_cast<long>((high - low) / (1.5 * width));
      for (long k = 0; k <= steps; ++k)
        starts.push_back(
            {{low + 1.5 * width * static_cast<double>(k), width, target().typical_size()}});
    }
    return starts;
  }

  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    if (!is_sparse() || found.p[1] < 0.5 * spacing()) return others;
    for (const double away : {-0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4})
      for (const double ratio : {0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.6})
        others.push_back({{found.p[0] + away * spacing(), ratio * found.p[1], found.p[2]}});
    return others;
  }

 private:
  /// Whether a bell may stand between two of its values, where nothing tells its height.
  bool is_sparse() const {
    constexpr int kDense = 12;
    return !resolves(kDense);
  }
  std::vector<double> values_seen() const {
    const std::set<double> values(variable().value[0].begin(), variable().value[0].end());
    return {values.begin(), values.end()};
  }
  double spacing() const {
    const auto [low, high] = range();
    return (high - low) / static_cast<double>(std::max<std::size_t>(1, values_seen().size() - 1));
  }
  std::string function() const override { return "bell"; }
  double at(double value, const double* p) const override {
    const double away = value - p[0];
    const double x = (variable().angle ? std::remainder(away, effect::kTurn_rad) : away) / p[1];
    return p[2] * std::exp(-0.5 * x * x);
  }
};

class Resonance final : public AboutAPlace {
 public:
  using AboutAPlace::AboutAPlace;

  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return everywhere(16, {0.03, 0.1});
  }

 private:
  std::string function() const override { return "resonance"; }
  double at(double value, const double* p) const override {
    const double x = (value - p[0]) / p[1];
    return p[2] / (1 + x * x);
  }
};

/// A load that goes by tilts the ground under it to one side, then to the other.
class Passage final : public AboutAPlace {
 public:
  using AboutAPlace::AboutAPlace;

  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    return everywhere(24, {0.02, 0.06});
  }

 private:
  std::string function() const override { return "passage"; }
  double at(double value, const double* p) const override {
    const double x = (value - p[0]) / p[1];
    return p[2] * 2 * x / (1 + x * x);
  }
};

class Seam final : public AboutAPlace {
 public:
  using AboutAPlace::AboutAPlace;

  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    std::vector<Hypothesis> starts;
    if (is_of_another_axis(axis)) return starts;
    const auto [low, high] = range();
    for (const double share : {1.0 / 40, 1.0 / 18, 1.0 / 8}) {
      const double width = share * (high - low);
      for (int k = 1; low + k * width < high; ++k)
        starts.push_back({{low + k * width, width, target().typical_size()}});
    }
    return starts;
  }

 private:
  std::string function() const override { return "seam"; }
  /// p: what it comes to at most.
  double at(double value, const double* p) const override {
    const double x = (value - p[0]) / p[1];
    return p[2] * x * std::exp(0.5 - 0.5 * x * x);
  }
};

/// Piece by piece: what a code of the band lacks to the edge that all of them read as.
class MissingBand final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    return {place("middle"),
            {"width", variable().unit(), ParameterRole::shape},
            {"edge", variable().unit(), ParameterRole::index},
            {"side", "", ParameterRole::index},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    constexpr double kApart = 0.3;  // of a width
    std::vector<Hypothesis> starts;
    if (variable().output_of != axis) return starts;
    const auto [low, high] = range();
    for (const double share : kWidths) {
      const double width = share * (high - low);
      for (int k = 0; low + (0.5 + kApart * k) * width < high; ++k)
        add(low + (0.5 + kApart * k) * width, width, starts);
    }
    return starts;
  }
  /// Each of its edges may pass for a step of the code.
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t axis, const Effect& repeated,
                                 const std::vector<std::vector<double>>& steps) const override {
    std::vector<Hypothesis> found;
    if (repeated.id() != "adc.code_step" || variable().output_of != axis) return found;
    for (const auto& step : steps)
      for (const double share : kWidths)
        for (const double away : {-0.5, 0.0, 0.5}) {
          const double width = share * (range().second - range().first);
          add(step[1] + away * width, width, found);
        }
    return found;
  }

 private:
  static constexpr std::array kWidths = {1.0 / 30, 1.0 / 15, 1.0 / 8};  // of the range

  void add(double middle, double width, std::vector<Hypothesis>& starts) const {
    constexpr double kLeast = 0.004;
    const double least = kLeast * (range().second - range().first);
    for (const double side : {-1.0, 1.0})
      starts.push_back(
          {{middle, width, std::max(variable().scatter, least), side, target().typical_size()}});
  }
  std::string function() const override { return "band that is missing"; }
  /// p: of a code at the far edge. Mean over readings that scatter.
  double at(double value, const double* p) const override {
    const double half = 0.5 * p[1], sd = std::abs(p[2]);
    const double to_edge = half - p[3] * (value - p[0]);  // from the side that reads right
    const double within =
        effect::share_below(to_edge, 0, sd) - effect::share_below(to_edge - p[1], 0, sd);
    const double at_edges = density(to_edge, sd) - density(to_edge - p[1], sd);
    return p[4] / p[1] * (to_edge * within + sd * sd * at_edges);
  }
  static double density(double x, double sd) {
    return std::exp(-0.5 * x * x / (sd * sd)) / (sd * std::sqrt(2 * std::numbers::pi));
  }
};

class Sector final : public DrivenTerm {
 public:
  using DrivenTerm::DrivenTerm;

  std::vector<ParameterInfo> parameters() const override {
    const double fine = kFine * kEdge_rad;
    return {{"middle", "rad", ParameterRole::shape, fine, true},
            {"width", "rad", ParameterRole::shape, fine},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    // So that both edges come within reach of closer(); nearly so for a scale, which has rivals.
    const double step_rad = (form() == TermForm::scale ? 30 : 15) * kRadPerDeg;
    for (const double width_rad : {0.7, 1.2, 2.0, 2.8}) {
      const auto steps = static_cast<int>(std::ceil((high - low) / step_rad));
      for (int k = 0; k < steps; ++k)
        starts.push_back({{low + k * step_rad, width_rad, target().typical_size()}});
    }
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    // Between two positions nothing moves an edge: each is tried at several.
    constexpr int kPlaces = 3;
    constexpr double kApart_rad = 5 * kRadPerDeg;
    std::vector<Hypothesis> others;
    for (int low = -kPlaces; low <= kPlaces; ++low)
      for (int high = -kPlaces; high <= kPlaces; ++high) {
        const double width_rad = found.p[1] + kApart_rad * (high - low);
        if (width_rad > kApart_rad)
          others.push_back({{found.p[0] + 0.5 * kApart_rad * (high + low), width_rad, found.p[2]}});
      }
    return others;
  }

 private:
  static constexpr double kEdge_rad = 1 * kRadPerDeg;
  static constexpr double kFine = 0.1;

  std::string function() const override { return "sector"; }
  double at(double value, const double* p) const override {
    const double from_middle = std::abs(std::remainder(value - p[0], effect::kTurn_rad));
    return p[2] / (1 + std::exp((from_middle - 0.5 * p[1]) / kEdge_rad));
  }
};

}  // namespace

std::unique_ptr<SmoothTerm> one_position(DriverPointer angle, const Target& target) {
  return std::make_unique<OnePosition>(std::move(angle), target);
}
std::unique_ptr<SmoothTerm> bell(DriverPointer driver, const Target& target) {
  return std::make_unique<Bell>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> resonance(DriverPointer driver, const Target& target) {
  return std::make_unique<Resonance>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> passage(DriverPointer driver, const Target& target) {
  return std::make_unique<Passage>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> seam(DriverPointer driver, const Target& target) {
  return std::make_unique<Seam>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> missing_band(DriverPointer code, const Target& target) {
  return std::make_unique<MissingBand>(std::move(code), target);
}
std::unique_ptr<SmoothTerm> sector(DriverPointer angle, const Target& target) {
  return std::make_unique<Sector>(std::move(angle), target);
}

}  // namespace plumbline
