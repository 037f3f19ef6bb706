// What follows a driver late, by how far it went and not by the time that passed.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "estimator/effects/driven_term.h"
#include "estimator/effects/place.h"

namespace plumbline {
namespace {

/// The way to a visit leads over all visits before it: it is gone once for all of them, and kept
/// for those that are asked for next. The last parameter is the amplitude.
class Lag : public DrivenTerm {
 public:
  Lag(DriverPointer driver, const Target& target, std::size_t shapes)
      : DrivenTerm(std::move(driver), target), shapes_(shapes) {}

  bool remembers() const override { return true; }
  bool guesses_at_start() const override { return true; }

 private:
  /// At every visit, for an amplitude of 1.
  virtual std::vector<double> course(std::size_t axis, const double* shape) const = 0;
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    struct Kept {
      std::uint64_t of = 0;
      std::size_t axis = 0;
      std::vector<double> shape, course;
    };
    constexpr std::size_t kMost = 8;  // such terms in one model
    thread_local std::array<Kept, kMost> all;
    thread_local std::size_t next = 0;
    auto kept = std::find_if(all.begin(), all.end(), [&](const Kept& k) {
      return k.of == number_ && k.axis == axis && std::equal(k.shape.begin(), k.shape.end(), p);
    });
    if (kept == all.end()) {
      kept = all.begin() + static_cast<std::ptrdiff_t>(next++ % kMost);
      *kept = {number_, axis, {p, p + shapes_}, course(axis, p)};
    }
    return p[shapes_] * kept->course[visit];
  }
  /// Unlike its address, no other term ever has it.
  static std::uint64_t next_number() {
    static std::atomic<std::uint64_t> last = 0;
    return ++last;
  }

  std::size_t shapes_;
  std::uint64_t number_ = next_number();
};

/// What follows the driver through a play, itself or by how much it lags behind.
class Play final : public Lag {
 public:
  Play(DriverPointer driver, const Target& target, OfPlay of)
      : Lag(std::move(driver), target, of == OfPlay::lag ? 2 : 3), of_(of) {}

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {
        {"width", variable().unit(), ParameterRole::shape},
        {.name = "start", .unit = "", .role = ParameterRole::index, .unrecorded = true}};
    if (of_ == OfPlay::follower) infos.push_back({"ref", variable().unit(), ParameterRole::index});
    infos.push_back({"p", target().unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double share : {0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65})
      if (const double width = share * (high - low); shows(axis, width, kMiddle))
        starts.push_back(at_reference({width, kMiddle, target().typical_size()}));
    return starts;
  }
  // Wherever a visit begins to draw or ceases to, the fit may stop.
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t axis,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    for (const double off : effect::geometric(0.004, 0.12, 6))
      for (const double ratio : {1 - off, 1 + off})
        others.push_back(at_reference({ratio * found.p[0], found.p[1], found.p.back()}));
    for (const double start : {-1.0, -0.5, 0.5, 1.0})
      for (const double ratio : {0.75, 1.0})
        if (shows(axis, ratio * found.p[0], start))
          others.push_back(at_reference({ratio * found.p[0], start, found.p.back()}));
    return others;
  }

 private:
  static constexpr double kMiddle = 0;

  std::string function() const override {
    return of_ == OfPlay::lag ? "lag behind a play" : "drawn through a play";
  }
  /// Width, start and amplitude as parameters().
  Hypothesis at_reference(std::vector<double> p) const {
    if (of_ == OfPlay::follower) p.insert(p.end() - 1, variable().reference.value_or(0));
    return {std::move(p)};
  }
  /// What came before the first visit drew the follower to one end of the play (−1: the lower) or
  /// left it between them.
  static double at_start(double driver, double half, double start) {
    return driver + half * std::clamp(start, -1.0, 1.0);
  }
  /// While the driver goes one way only, the lag is a function of it: it must have come back after
  /// it drew. What starts elsewhere is told from what starts in the middle, with another width,
  /// only when it was drawn both ways.
  bool shows(std::size_t axis, double width, double start) const {
    constexpr double kBack = 0.1;  // of the width
    const std::vector<double>& driver = variable().value[axis];
    const double half = 0.5 * width;
    bool up = false, down = false, back = false;
    double follower = at_start(driver.front(), half, start);
    for (const double value : driver) {
      const double off = value - follower;
      up |= off > half;
      down |= off < -half;
      back |= (up && off < half - kBack * width) || (down && off > kBack * width - half);
      follower = std::clamp(follower, value - half, value + half);
    }
    return start == kMiddle ? back : up && down;
  }
  std::vector<double> course(std::size_t axis, const double* shape) const override {
    const std::vector<double>& driver = variable().value[axis];
    const double half = 0.5 * std::abs(shape[0]);
    std::vector<double> course(driver.size());
    double follower = 0;
    for (std::size_t k = 0; k < driver.size(); ++k) {
      if (variable().way_begins(k)) follower = at_start(driver[k], half, shape[1]);
      follower = std::clamp(follower, driver[k] - half, driver[k] + half);
      course[k] = follower - (of_ == OfPlay::lag ? driver[k] : shape[2]);
    }
    return course;
  }

  OfPlay of_;
};

/// Friction in a spring: what was drawn to one side is at the end of its reach, and gives back
/// before it is drawn to the other (Dahl 1968; with `release` other than 1 Bouc and Wen).
class FrictionLag final : public Lag {
 public:
  FrictionLag(DriverPointer driver, const Target& target) : Lag(std::move(driver), target, 2) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"reach", variable().unit(), ParameterRole::shape},
            {"release", "", ParameterRole::index},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr double kRelease = 0.5;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (const double share : effect::geometric(0.02, 0.5, 5))
      starts.push_back({{share * (high - low), kRelease, target().typical_size()}});
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    for (const double release : {0.0, 0.25, 0.75, 1.0, 1.5})
      others.push_back({{found.p[0], release, found.p[2]}});
    // Where all is drawn to the end, little tells how long the reach is.
    for (const double ratio : {0.03, 0.1, 0.3})
      others.push_back({{ratio * found.p[0], found.p[1], found.p[2]}});
    return others;
  }

 private:
  std::string function() const override { return "friction"; }
  std::vector<double> course(std::size_t axis, const double* shape) const override {
    const std::vector<double>& driver = variable().value[axis];
    const double reach = std::abs(shape[0]), release = shape[1];
    std::vector<double> drawn(driver.size());
    for (std::size_t k = 1; reach > 0 && k < driver.size(); ++k)
      if (!variable().way_begins(k))
        drawn[k] = drawn_on(drawn[k - 1], (driver[k] - driver[k - 1]) / reach, release);
    return drawn;
  }
  /// From −1 to 1, after a way in units of the reach.
  static double drawn_on(double drawn, double way, double release) {
    const double side = way < 0 ? -1 : 1;
    double along = side * drawn, left = std::abs(way);
    if (along < 0) {
      const double to_nothing = release > 0 ? std::log1p(-release * along) / release : -along;
      if (left < to_nothing) {
        const double given_back = release > 0 ? -std::expm1(-release * left) / release : left;
        return side * (along + given_back * (1 - release * along));
      }
      left -= to_nothing;
      along = 0;
    }
    return side * (1 - (1 - along) * std::exp(-left));
  }
};

class Relay final : public Lag {
 public:
  Relay(DriverPointer driver, const Target& target) : Lag(std::move(driver), target, 3) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {.name = "start", .unit = "", .role = ParameterRole::index, .unrecorded = true},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 12;
    const auto [low, high] = range();
    std::vector<Hypothesis> starts;
    for (int from = 1; from < kParts; ++from)
      for (int to = from + 1; to < kParts; ++to)
        starts.push_back({{low + (high - low) * from / kParts, low + (high - low) * to / kParts, 1,
                           target().typical_size()}});
    return starts;
  }
  // Nothing moves a threshold between two values.
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    constexpr int kPlaces = 4;  // on either side
    constexpr double kApart = 0.02;
    const double apart = kApart * (range().second - range().first);
    std::vector<Hypothesis> others;
    for (int low = -kPlaces; low <= kPlaces; ++low)
      for (int high = -kPlaces; high <= kPlaces; ++high)
        for (const double start : {-1.0, 1.0})
          others.push_back(
              {{found.p[0] + apart * low, found.p[1] + apart * high, start, found.p[3]}});
    return others;
  }
  double choice_uncertainty(const VisitLog&, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    return k < 2 ? effect::u_between_neighbours(variable().value[axis], p[k]) : 0;
  }

 private:
  std::string function() const override { return "relay"; }
  std::vector<double> course(std::size_t axis, const double* shape) const override {
    double state = shape[2];
    std::vector<double> states;
    for (const double value : variable().value[axis]) {
      if (value > shape[1]) state = 1;
      if (value < shape[0]) state = -1;
      states.push_back(state);
    }
    return states;
  }
};

}  // namespace

std::unique_ptr<SmoothTerm> relay(DriverPointer driver, const Target& target) {
  return std::make_unique<Relay>(std::move(driver), target);
}
std::unique_ptr<SmoothTerm> play(DriverPointer driver, const Target& target, OfPlay of) {
  return std::make_unique<Play>(std::move(driver), target, of);
}
std::unique_ptr<SmoothTerm> friction(DriverPointer driver, const Target& target) {
  return std::make_unique<FrictionLag>(std::move(driver), target);
}

}  // namespace plumbline
