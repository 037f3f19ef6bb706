// What depends on two variables at once.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "estimator/effects/driven_term.h"

namespace plumbline {
namespace {

// What is finer has too many companions to be told from them.
constexpr int kHighestHarmonic = 6;

/// From −1 to 1 over a range.
double position(double value, double low, double high) {
  return (2 * value - low - high) / (high - low);
}

/// A harmonic of an angle whose amplitude and phase follow another variable in a straight line or a
/// parabola.
class LineTimesHarmonic final : public DrivenTerm {
 public:
  LineTimesHarmonic(DriverPointer driver, DriverPointer angle, Target target, unsigned degree)
      : DrivenTerm(std::move(driver), target), angle_(std::move(angle)), degree_(degree) {}

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {{"low", variable().unit(), ParameterRole::index},
                                        {"high", variable().unit(), ParameterRole::index},
                                        {"n", "", ParameterRole::index}};
    for (unsigned d = 0; d <= degree_; ++d)
      for (const char* part : {"c", "s"})
        infos.push_back({part + std::to_string(d), target().unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<Hypothesis> starts;
    if (!angle_->varies() || !resolves(static_cast<int>(degree_))) return starts;
    std::vector<double> p(parameters().size(), target().typical_size());
    std::tie(p[0], p[1]) = range();
    for (int n = 1; n <= kHighestHarmonic; ++n) {
      p[2] = n;
      starts.push_back({p});
    }
    return starts;
  }
  bool same_numbers_on_axes() const override {
    return DrivenTerm::same_numbers_on_axes() && angle_->same_on_axes;
  }

 private:
  std::string function() const override {
    return (degree_ == 1 ? "straight line, times a harmonic of "
                         : "parabola, times a harmonic of ") +
           angle_->name;
  }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double x = position(variable().value[axis][visit], p[0], p[1]);
    const double phase = p[2] * angle_->value[axis][visit];
    const std::array legendre = {1.0, x, 1.5 * x * x - 0.5};
    double cosine = 0, sine = 0;
    for (unsigned d = 0; d <= degree_; ++d) {
      cosine += p[3 + 2 * d] * legendre[d];
      sine += p[4 + 2 * d] * legendre[d];
    }
    return cosine * std::cos(phase) + sine * std::sin(phase);
  }

  DriverPointer angle_;
  unsigned degree_;
};

/// With what each does by itself: where its zero lies nobody knows.
class LineTimesLine final : public DrivenTerm {
 public:
  LineTimesLine(DriverPointer driver, DriverPointer other, Target target)
      : DrivenTerm(std::move(driver), target), other_(std::move(other)) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {"other_low", other_->unit(), ParameterRole::index},
            {"other_high", other_->unit(), ParameterRole::index},
            {"p10", target().unit(), ParameterRole::amplitude},
            {"p01", target().unit(), ParameterRole::amplitude},
            {"p11", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<std::string> columns() const override {
    std::vector<std::string> columns = variable().columns();
    for (std::string& column : other_->columns()) columns.push_back(std::move(column));
    return columns;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    const auto [other_low, other_high] =
        std::minmax_element(other_->value[axis].begin(), other_->value[axis].end());
    if (!(high > low) || !(*other_high > *other_low)) return {};
    const double size = target().typical_size();
    return {{{low, high, *other_low, *other_high, size, size, size}}};
  }
  bool same_numbers_on_axes() const override {
    return DrivenTerm::same_numbers_on_axes() && other_->same_on_axes;
  }

 private:
  std::string function() const override { return "straight line, times that of " + other_->name; }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double x = position(variable().value[axis][visit], p[0], p[1]);
    const double y = position(other_->value[axis][visit], p[2], p[3]);
    return p[4] * x + p[5] * y + p[6] * x * y;
  }

  DriverPointer other_;
};

/// What turns under the triad as the earth's field does, only not always as strong.
class LineTimesField final : public DrivenTerm {
 public:
  LineTimesField(DriverPointer driver, DriverPointer delta, DriverPointer h, Target target)
      : DrivenTerm(std::move(driver), target), delta_(std::move(delta)), h_(std::move(h)) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {"m1_0", "g", ParameterRole::amplitude},
            {"m2_0", "g", ParameterRole::amplitude},
            {"m1_1", "g", ParameterRole::amplitude},
            {"m2_1", "g", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    const auto [low, high] = range();
    if (!(high > low)) return {};
    const double m1 = target().typical_size();
    const double m2 = axis == 2 ? 0 : m1;  // the spindle axis never sees y_b
    return {{{low, high, 0, 0, m1, m2}}, {{low, high, m1, m2, m1, m2}}};
  }
  bool same_numbers_on_axes() const override { return false; }  // each sees its share of it

 private:
  std::string function() const override { return "straight line, times a field of the base"; }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double x = position(variable().value[axis][visit], p[0], p[1]);
    const HorizontalAxes seen = horizontal_axes(delta_->value[axis][visit], h_->value[axis][visit]);
    const auto i = static_cast<Eigen::Index>(axis);
    return (p[2] + p[4] * x) * seen.x_b(i) + (p[3] + p[5] * x) * seen.y_b(i);
  }

  DriverPointer delta_, h_;
};

/// What falls on one side of the turntable, as light does, only not always as strong.
class LineOnOneSide final : public DrivenTerm {
 public:
  LineOnOneSide(DriverPointer driver, DriverPointer delta, DriverPointer h, Target target)
      : DrivenTerm(std::move(driver), target), delta_(std::move(delta)), h_(std::move(h)) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {"middle", "rad", ParameterRole::shape, 0.1 * kRadPerDeg, true},
            {"p0", target().unit(), ParameterRole::amplitude},
            {"p1", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kParts = 12;
    std::vector<Hypothesis> starts;
    if (!resolves(1) || !delta_->varies()) return starts;
    const auto [low, high] = range();
    const double size = target().typical_size();
    for (int k = 0; k < kParts; ++k)
      starts.push_back({{low, high, effect::kTurn_rad * k / kParts, size, size}});
    return starts;
  }
  bool same_numbers_on_axes() const override {
    return DrivenTerm::same_numbers_on_axes() && delta_->same_on_axes && h_->same_on_axes;
  }

 private:
  std::string function() const override { return "straight line, on one side of the turn"; }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double towards = std::cos(delta_->value[axis][visit] - p[2]);
    if (towards < 0) return 0;
    const double x = position(variable().value[axis][visit], p[0], p[1]);
    return (p[3] + p[4] * x) * towards * std::cos(h_->value[axis][visit]);
  }

  DriverPointer delta_, h_;
};

/// A straight line in one part of an angle's range and nothing elsewhere: what happens at a place
/// where something else varies.
class LineInAPart final : public DrivenTerm {
 public:
  LineInAPart(DriverPointer driver, DriverPointer angle, Target target)
      : DrivenTerm(std::move(driver), target), angle_(std::move(angle)) {}

  std::vector<ParameterInfo> parameters() const override {
    // Between two positions nothing moves an edge.
    return {{"low", variable().unit(), ParameterRole::index},
            {"high", variable().unit(), ParameterRole::index},
            {"middle", "rad", ParameterRole::index},
            {"width", "rad", ParameterRole::index},
            {"p0", target().unit(), ParameterRole::amplitude},
            {"p1", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    std::vector<Hypothesis> starts;
    if (!angle_->varies() || !resolves(1)) return starts;
    const auto [first, last] =
        std::minmax_element(angle_->value[0].begin(), angle_->value[0].end());
    if (angle_->angle) {
      for (const double width_rad : {0.7, 1.4, 2.4})
        for (int k = 0; *first + k * kApart_rad < *last; ++k)
          add(*first + k * kApart_rad, width_rad, starts);
      return starts;
    }
    // From one end of the range to a place.
    constexpr int kParts = 9;
    for (int k = 1; k < kParts; ++k) {
      const double part_rad = (*last - *first) * k / kParts;
      add(*first, 2 * part_rad, starts);
      add(*last, 2 * part_rad, starts);
    }
    return starts;
  }
  std::vector<Hypothesis> closer(const VisitLog&, std::size_t,
                                 const Hypothesis& found) const override {
    constexpr int kPlaces = 2;
    std::vector<Hypothesis> others;
    for (int low = -kPlaces; angle_->angle && low <= kPlaces; ++low)
      for (int high = -kPlaces; high <= kPlaces; ++high) {
        Hypothesis& moved = others.emplace_back(found);
        moved.p[2] += 0.25 * kApart_rad * (low + high);
        moved.p[3] += 0.5 * kApart_rad * (high - low);
      }
    return others;
  }
  bool same_numbers_on_axes() const override {
    return DrivenTerm::same_numbers_on_axes() && angle_->same_on_axes;
  }

 private:
  static constexpr double kApart_rad = 15 * kRadPerDeg;

  std::string function() const override { return "straight line in a part of " + angle_->name; }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double away_rad = angle_->value[axis][visit] - p[2];
    const double from_middle_rad =
        std::abs(angle_->angle ? std::remainder(away_rad, effect::kTurn_rad) : away_rad);
    if (!(from_middle_rad < 0.5 * p[3])) return 0;
    return p[4] + p[5] * position(variable().value[axis][visit], p[0], p[1]);
  }
  void add(double middle_rad, double width_rad, std::vector<Hypothesis>& starts) const {
    const double size = target().typical_size();
    starts.push_back({{range().first, range().second, middle_rad, width_rad, size, size}});
  }

  DriverPointer angle_;
};

/// A pattern on the sphere that no component of the specific force makes.
class HarmonicTimesHarmonic final : public DrivenTerm {
 public:
  HarmonicTimesHarmonic(DriverPointer angle, DriverPointer other, Target target)
      : DrivenTerm(std::move(angle), target), other_(std::move(other)) {}

  bool repeats() const override { return true; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"n", "", ParameterRole::index},
            {"m", "", ParameterRole::index},
            {"cc", target().unit(), ParameterRole::amplitude},
            {"sc", target().unit(), ParameterRole::amplitude},
            {"cs", target().unit(), ParameterRole::amplitude},
            {"ss", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    const double size = target().typical_size();
    std::vector<Hypothesis> starts;
    if (!other_->varies()) return starts;
    for (int n = 1; n <= kHighestHarmonic; ++n)
      for (int m = 1; m <= kHighestHarmonic; ++m)
        starts.push_back(
            {{static_cast<double>(n), static_cast<double>(m), size, size, size, size}});
    return starts;
  }
  bool same_numbers_on_axes() const override {
    return DrivenTerm::same_numbers_on_axes() && other_->same_on_axes;
  }

 private:
  std::string function() const override { return "harmonic, times a harmonic of " + other_->name; }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double phase = p[0] * variable().value[axis][visit];
    const double other = p[1] * other_->value[axis][visit];
    return (p[2] * std::cos(other) + p[4] * std::sin(other)) * std::cos(phase) +
           (p[3] * std::cos(other) + p[5] * std::sin(other)) * std::sin(phase);
  }

  DriverPointer other_;
};

/// Something about one place of two angles and nothing elsewhere: what stands beside the head.
class Spot final : public DrivenTerm {
 public:
  Spot(DriverPointer angle, DriverPointer other, Target target)
      : DrivenTerm(std::move(angle), target),
        other_(std::move(other)),
        least_width_rad_(part_of_spacing(variable())),
        other_least_width_rad_(part_of_spacing(*other_)) {}

  std::vector<ParameterInfo> parameters() const override {
    return {{"middle", "rad", ParameterRole::shape},
            {"width", "rad", ParameterRole::shape},
            {"other_middle", "rad", ParameterRole::shape},
            {"other_width", "rad", ParameterRole::shape},
            {"p", target().unit(), ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    constexpr int kAround = 12, kAcross = 4;
    const auto [low, high] = std::minmax_element(other_->value[0].begin(), other_->value[0].end());
    std::vector<Hypothesis> starts;
    if (!(*high > *low) || !resolves(kAround / 2)) return starts;
    for (int around = 0; around < kAround; ++around)
      for (int across = 0; across < kAcross; ++across)
        for (const double width_rad : {15 * kRadPerDeg, 35 * kRadPerDeg})
          starts.push_back({{effect::kTurn_rad * around / kAround, width_rad,
                             std::lerp(*low, *high, static_cast<double>(across) / (kAcross - 1)),
                             0.6 * width_rad, target().typical_size()}});
    return starts;
  }
  bool same_numbers_on_axes() const override {
    return DrivenTerm::same_numbers_on_axes() && other_->same_on_axes;
  }

 private:
  static double part_of_spacing(const Driver& angle) {
    constexpr double kPart = 0.4;
    const auto [low, high] = std::minmax_element(angle.value[0].begin(), angle.value[0].end());
    return kPart * (*high - *low) / std::max(1.0, static_cast<double>(angle.fewest_values) - 1);
  }
  std::string function() const override { return "bell, times a bell of " + other_->name; }
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override {
    const double x = std::remainder(variable().value[axis][visit] - p[0], effect::kTurn_rad) / p[1];
    const double y = (other_->value[axis][visit] - p[2]) / p[3];
    // Between two positions it would be anything.
    if (std::abs(p[1]) < least_width_rad_ || std::abs(p[3]) < other_least_width_rad_) return 0;
    return p[4] * std::exp(-0.5 * (x * x + y * y));
  }

  DriverPointer other_;
  double least_width_rad_, other_least_width_rad_;
};

}  // namespace

std::unique_ptr<SmoothTerm> spot(DriverPointer angle, DriverPointer other, const Target& target) {
  return std::make_unique<Spot>(std::move(angle), std::move(other), target);
}
std::unique_ptr<SmoothTerm> line_times_harmonic(DriverPointer driver, DriverPointer angle,
                                                const Target& target) {
  return std::make_unique<LineTimesHarmonic>(std::move(driver), std::move(angle), target, 1);
}
std::unique_ptr<SmoothTerm> parabola_times_harmonic(DriverPointer driver, DriverPointer angle,
                                                    const Target& target) {
  return std::make_unique<LineTimesHarmonic>(std::move(driver), std::move(angle), target, 2);
}
std::unique_ptr<SmoothTerm> line_in_a_part(DriverPointer driver, DriverPointer angle,
                                           const Target& target) {
  return std::make_unique<LineInAPart>(std::move(driver), std::move(angle), target);
}
std::unique_ptr<SmoothTerm> line_times_line(DriverPointer driver, DriverPointer other,
                                            const Target& target) {
  return std::make_unique<LineTimesLine>(std::move(driver), std::move(other), target);
}
std::unique_ptr<SmoothTerm> line_times_field(DriverPointer driver, DriverPointer delta,
                                             DriverPointer h, const Target& target) {
  return std::make_unique<LineTimesField>(std::move(driver), std::move(delta), std::move(h),
                                          target);
}
std::unique_ptr<SmoothTerm> line_on_one_side(DriverPointer driver, DriverPointer delta,
                                             DriverPointer h, const Target& target) {
  return std::make_unique<LineOnOneSide>(std::move(driver), std::move(delta), std::move(h), target);
}
std::unique_ptr<SmoothTerm> harmonic_times_harmonic(DriverPointer angle, DriverPointer other,
                                                    const Target& target) {
  return std::make_unique<HarmonicTimesHarmonic>(std::move(angle), std::move(other), target);
}

}  // namespace plumbline
