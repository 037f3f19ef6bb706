#include "estimator/effects/smooth_term.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "estimator/effects/base_tilt.h"
#include "estimator/effects/driver.h"
#include "estimator/effects/dwell_course.h"
#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/head_decay.h"
#include "estimator/effects/memory_term.h"
#include "estimator/effects/steady_line.h"
#include "estimator/effects/telegraph.h"
#include "estimator/effects/turn_about_axes.h"

namespace plumbline {

const char* to_string(TermForm form) {
  switch (form) {
    case TermForm::bias:
      return "bias";
    case TermForm::scale:
      return "scale";
    case TermForm::sample:
      return "sample";
    case TermForm::geometry:
      break;
  }
  return "geometry";
}

bool SmoothTerm::is(const std::string& a_driver, const std::string& a_form,
                    const std::string& a_shape) const {
  return driver() == a_driver && to_string(form()) == a_form && shape() == a_shape;
}

namespace {

/// The mean of the readings stands for the converter's code.
Driver code_driver(const VisitLog& log, std::size_t axis) {
  Driver driver{std::string("code_") + kAxisName[axis], "", {}};
  driver.in_the_twelve = true;
  driver.output_of = axis;
  driver.scatter = log.input_sd_V[axis];
  for (const Visit& visit : log.visits)
    for (auto& values : driver.value) values.push_back(visit.mean_V[axis]);
  return driver;
}

/// δ as a stretch from 0 to 360°.
Driver angle_without_return(const VisitLog& log) {
  Driver driver{"delta_deg", "angle that does not close", {}};
  driver.span = {0, effect::kTurn_rad};  // a cable is at rest half way
  for (const Visit& visit : log.visits)
    for (auto& values : driver.value) {
      const double turn = std::fmod(visit.delta_rad, effect::kTurn_rad);
      values.push_back(turn < 0 ? turn + effect::kTurn_rad : turn);
    }
  return driver;
}

/// An angle that follows the load as it turns with the tilt.
std::array<Target, 2> pulled(const Target& angle) {
  Target by_cosine = angle, by_sine = angle;
  by_cosine.pull = Pull::cosine_of_h;
  by_sine.pull = Pull::sine_of_h;
  return {by_cosine, by_sine};
}

/// How far the values that a driver takes lie apart, as if evenly.
double spacing_of(const Driver& driver) {
  const auto [low, high] = std::minmax_element(driver.value[0].begin(), driver.value[0].end());
  return (*high - *low) / std::max<double>(1, static_cast<double>(driver.fewest_values) - 1);
}

/// The terms of a log, gathered driver by driver.
class TermList {
 public:
  TermList(const VisitLog& log, SmoothTermSelection selection)
      : log_(log), any_(selection == SmoothTermSelection::any) {}

  void add_all() {
    const auto add_line = [&](const DriverPointer& driver) { add_polynomials(driver, kBias, {1}); };
    for_each(instantaneous_drivers(log_), [&](const DriverPointer& driver) { add_of(driver); });
    add_of_two();
    for_each(loads_of_others(log_),
             [&](const DriverPointer& driver) { add(friction(driver, kBias)); });
    for_each(changes_of_others(log_), add_line);
    for_each(sizes_of_changes(log_), [&](const DriverPointer& driver) {
      for (const Target& target : {kBias, kDelta, kH}) {
        add_polynomials(driver, target, {1});
        add(power(driver, target));
      }
    });
    for_each({component_before(log_)},
             [&](const DriverPointer& driver) { add_polynomials(driver, kScale, {1}); });
    add_of_wound_up_spindle();
    add_of_directions();
    const auto attitude = shared(load(log_));
    if (any_ || attitude->varies()) {
      add(play(attitude, kBias, OfPlay::lag));
      add(friction(attitude, kBias));
      add(relay(attitude, kBias));
      add(relay(shared(size_of_load(log_)), kBias));
      add(friction(attitude, {.form = TermForm::scale, .second = 0}));
    }
    for (auto& term : memory_terms(log_, longest_s(), attitude, columns_)) add(std::move(term));
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const auto code = shared(code_driver(log_, axis));
      if (any_ || code->varies()) add_of_code(code);
    }
    add_of_dwells();
  }
  std::vector<std::unique_ptr<SmoothTerm>> take() { return std::move(terms_); }

 private:
  void add(std::unique_ptr<SmoothTerm> term) { terms_.push_back(std::move(term)); }
  /// Of the base, towards a direction of its own.
  void add_tilt(std::unique_ptr<SmoothTerm> of_h) { add(towards_a_direction(std::move(of_h))); }
  /// Of the triad, about an axis of its own.
  void add_seat(std::unique_ptr<SmoothTerm> of_y) { add(about_some_axis(std::move(of_y))); }
  /// A variable that never varied drives nothing.
  template <class Use>
  void for_each(std::vector<Driver> drivers, const Use& use) {
    for (Driver& each : drivers) {
      const auto driver = shared(std::move(each));
      if (any_ || driver->varies()) use(driver);
    }
  }
  void add_polynomials(const DriverPointer& driver, const Target& target,
                       std::initializer_list<int> degrees) {
    for (const int degree : degrees)
      add(driver->angle ? harmonic_series(driver, target, degree)
                        : polynomial(driver, target, degree));
  }
  /// Times a component of another axis.
  void add_polynomials_of_others(const DriverPointer& driver, std::initializer_list<int> degrees) {
    for (std::size_t other = 1; other < kAxisCount; ++other)
      add_polynomials(driver, {.form = TermForm::scale, .other = other}, degrees);
  }
  void add_steps(const DriverPointer& driver, const Target& target) {
    for (const StepEdge edge : {StepEdge::sharp, StepEdge::gradual})
      add(step(driver, target, edge));
  }

  void add_of(const DriverPointer& driver) {
    const bool clock = driver->is_clock(), column = driver->recorded && !driver->is_rate();
    if (driver->angle || driver->name == "h_deg") angles_.push_back(driver);
    if (driver->name == "h_deg" || driver->component) attitude_.push_back(driver);
    if (clock) clock_ = driver;
    if (driver->two_valued) {
      for (const Target& target : {kBias, kScale, kH}) add_polynomials(driver, target, {1});
      // A play that the load takes up, which turns with the tilt.
      for (const Target& target : pulled(kDelta)) add_polynomials(driver, target, {1});
      directions_.push_back(driver);
      return;
    }
    for (const Target& target : {kBias, kScale, kDelta, kH}) {
      // What a component does to the head is a function of the angles.
      if (driver->component && target.form == TermForm::geometry) continue;
      // A bias or scale that follows the time or a column in a straight line is a listed effect.
      const bool listed = (clock || column) && target.form != TermForm::geometry;
      if (any_ || !listed) add_polynomials(driver, target, {1});
      add_polynomials(driver, target, {2, 3, 5});
    }
    if (driver->recorded || clock) {
      add_polynomials_of_others(driver, {1, 2});
      for (std::size_t other = 0; other < kAxisCount; ++other)
        for (std::size_t second = other; second < kAxisCount; ++second)
          add_polynomials(driver, {.form = TermForm::scale, .other = other, .second = second}, {1});
      add_polynomials(driver, kRoll, {1, 2, 3});
      for (const int degree : {1, 2, 3}) add_tilt(polynomial(driver, kTilt, degree));
      for (const int degree : {1, 2}) add_seat(polynomial(driver, kSeat, degree));
      add_polynomials(driver, kSkew, {1, 2});
    }
    if (clock || column)
      for (const Target& target : {kBias, kScale}) add(bend(driver, target));
    if (column) add_of_column(driver);
    if (driver->past == "change of a_i since") add(bend(driver, kBias));
    if (driver->is_rate()) {
      add_steps(driver, kBias);
      add(bend(driver, kBias));
      rates_.push_back(driver);
    }
    if (clock) add_of_clock(driver);
    if (driver->in_the_twelve) add_of_component(driver);
    if (driver->angle) add_of_angle(driver);
    if (driver->name == "h_deg") add_harmonics_of_h(driver);
    if (driver->name == "delta_deg") add_harmonics_of_delta(driver);
  }
  void add_of_column(const DriverPointer& driver) {
    columns_.push_back(driver);
    for (const Target& target : {kBias, kScale, kDelta, kH}) add_steps(driver, target);
    add(relay(driver, kBias));
    for (const Target& target : {kBias, kScale})
      for (const OfPlay of : {OfPlay::lag, OfPlay::follower}) add(play(driver, target, of));
    add(power_beyond(driver, kBias));
    add(bell(driver, kBias));
    add(resonance(driver, kBias));
    add(wave(driver, kBias, {1.5, 0.5, 10}));
    add(saw_tooth(driver, kBias));  // a compensation that goes by steps
  }
  /// The longest time constant that the visits show.
  double longest_s() const {
    return any_ ? std::numeric_limits<double>::infinity() : log_.last_s() - log_.first_s();
  }
  void add_of_clock(const DriverPointer& clock) {
    add(bell(clock, kBias));
    for (const Target& target : {kBias, kScale, kDelta, kH, kRoll}) add(window(clock, target));
    for (std::size_t other = 1; other < kAxisCount; ++other)
      add(window(clock, {.form = TermForm::scale, .other = other}));
    add_tilt(window(clock, kTilt));
    add_seat(step(clock, kSeat, StepEdge::sharp));
    add_seat(decay(clock, kSeat, longest_s()));
    add_seat(logarithm(clock, kSeat));
    for (const Target& target : {kBias, kScale, kDelta, kH, kRoll})
      for (int switches = Telegraph::kFewest; switches <= Telegraph::kMost; ++switches)
        add(std::make_unique<Telegraph>(clock, target, switches));
    add(dying_wave(clock, kBias));
    add(pulses(clock, kBias));
    add(saw_tooth(clock, kBias));
    for (const Target& target : {kBias, kScale}) {
      add(relaxation(clock, target, longest_s()));
      add(power(clock, target));
      add(logarithm(clock, target));
    }
    for (const Target& target : {kBias, kScale, kDelta, kH, kRoll})
      add(wave(clock, target, {1.5, 0.5, 40}));
    // For the bias both are listed effects, and a step of delta is a slipped index.
    for (const Target& target : {kScale, kH, kRoll}) {
      add_steps(clock, target);
      add(decay(clock, target, longest_s()));
    }
    for (const StepEdge edge : {StepEdge::sharp, StepEdge::gradual})
      add_tilt(step(clock, kTilt, edge));
    add_tilt(decay(clock, kTilt, longest_s()));
    add_tilt(logarithm(clock, kTilt));
    add(in_both_directions(wave(clock, kTilt, {0.5, 0.5, 20})));
    for (const auto& shape : {bell, passage}) {
      for (const Target& target : {kH, kRoll}) add(shape(clock, target));
      add_tilt(shape(clock, kTilt));
    }
    for (std::size_t other = 1; other < kAxisCount; ++other)
      add(step(clock, {.form = TermForm::scale, .other = other}, StepEdge::sharp));
  }
  /// Of a component of the specific force.
  void add_of_component(const DriverPointer& driver) {
    // Products of third order.
    add_polynomials_of_others(driver, {2});
    for (std::size_t other = 0; other < kAxisCount; ++other)
      add(square(driver, {.form = TermForm::scale, .other = other}));
    for (std::size_t other = 0; other < kAxisCount; ++other)
      for (std::size_t second = other + 1; second < kAxisCount; ++second)
        add_polynomials(driver, {.form = TermForm::scale, .other = other, .second = second}, {1});
    for (const Target& target : {kBias, kScale}) add(bend(driver, target));
    add(gain_beyond(driver, kBias));
    // What the weight does to a gear that has play.
    add(bend(driver, kDelta));
    add(relay(driver, kDelta));
    add_steps(driver, kBias);
    add(step(driver, kScale, StepEdge::sharp));
    // A block that rocks, or stands on something soft at one side.
    add_seat(step(driver, kSeat, StepEdge::sharp));
    add_seat(bend(driver, kSeat));
    for (const auto& shape : {bell, seam}) add(shape(driver, kBias));
    add(wave(driver, kBias, {1.5, 0.5, 20}));
    add(saw_tooth(driver, kBias));
    add(pulses(driver, kBias));
    // What is no shape of its own.
    add_polynomials(driver, kBias, {4, 6, 8, 12});
  }
  void add_of_angle(const DriverPointer& angle) {
    add_polynomials_of_others(angle, {2, 3});
    for (const Target& target : {kDelta, kH}) add(one_position(angle, target));
    for (const Target& target : {kDelta, kH}) add(thrown(angle, target));
    for (const Target& target : {kBias, kDelta, kH}) add(bell(angle, target));
    for (const Target& target : {kBias, kScale, kDelta, kH}) add(sector(angle, target));
    for (const Target& target : {kRoll, kSkew}) add_polynomials(angle, target, {1, 2});
    for (const Target& target : {kBias, kDelta, kH, kRoll}) add(half_wave(angle, target));
  }
  /// From the second harmonic of the turn that is seen in part; the first is a listed effect.
  void add_harmonics_of_h(const DriverPointer& h) {
    const auto [low, high] = std::minmax_element(h->value[0].begin(), h->value[0].end());
    const double turns = h->varies() ? (*high - *low) / effect::kTurn_rad : 1;
    for (const Target& target : {kBias, kH, kDelta, kRoll})
      add(wave(h, target, {2 * turns, turns, 18 * turns}, 2 * spacing_of(*h)));
    add_polynomials(h, kRoll, {1, 2, 3, 5});
    for (const Target& target : {kBias, kScale}) add(bell(h, target));
    for (const Target& target : {kBias, kScale, kDelta, kH}) add(bend(h, target));
    add_steps(h, kRoll);
    for (const Target& target : {kDelta, kH}) {
      add(one_position(h, target));
      add(harmonic(h, target, 9));
      add_steps(h, target);
      add(bell(h, target));
    }
  }
  void add_harmonics_of_delta(const DriverPointer& delta) {
    for (const Target& target : {kBias, kScale}) add(harmonic(delta, target, 3));
    for (const Target& target : {kH, kRoll}) add(harmonic(delta, target, 1));
    constexpr int kFirstUnlisted = 18;
    add(harmonic(delta, kDelta, kFirstUnlisted));
    add(harmonics_of_part(delta, kDelta));
    add(saw_tooth(delta, kDelta));
    for (const Target& angle : {kDelta, kH})
      for (const Target& target : pulled(angle)) add(harmonic(delta, target, 1));
  }
  /// Where the visits' positions are not the only thing that a pattern over them follows.
  void add_of_two() {
    std::vector<DriverPointer> followed = columns_;
    if (clock_) followed.push_back(clock_);
    if (angles_.size() == 2) {
      add(harmonic_times_harmonic(angles_[0], angles_[1], kBias));
      add(spot(angles_[0], angles_[1], kBias));
      followed.push_back(angles_[1]);
    }
    for (const DriverPointer& rate : rates_)
      for (const DriverPointer& angle : angles_) add(line_times_harmonic(rate, angle, kBias));
    for (const DriverPointer& driver : followed)
      for (const DriverPointer& angle : angles_) {
        if (driver == angle) continue;
        add(line_in_a_part(driver, angle, kBias));
        add(line_times_harmonic(driver, angle, kBias));
        add(line_times_harmonic(driver, angle, angle->angle ? kDelta : kH));
      }
    if (angles_.size() == 2)
      for (const DriverPointer& driver : followed)
        if (driver != angles_[1]) {
          add(line_times_field(driver, angles_[0], angles_[1], kBias));
          add(line_on_one_side(driver, angles_[0], angles_[1], kBias));
        }
    // A play that the load takes up, which turns with the spindle.
    for (const DriverPointer& direction : directions_)
      if (!angles_.empty() && angles_[0]->angle)
        add(line_times_harmonic(direction, angles_[0], kDelta));
    // What the weight does to a wheel grows with its moment about the axis, which need be no line.
    if (angles_.size() == 2) add(parabola_times_harmonic(angles_[1], angles_[0], kDelta));
    for (std::size_t one = 0; one < columns_.size(); ++one)
      for (std::size_t other = one + 1; other < columns_.size(); ++other)
        add(line_times_line(columns_[one], columns_[other], kBias));
  }
  /// What winds up with the spindle does not know that 360° are 0°.
  void add_of_wound_up_spindle() {
    const auto turn = shared(angle_without_return(log_));
    for (const Target& target : {kBias, kScale, kDelta, kH})
      add_polynomials(turn, target, {1, 2, 3});
    for (const Target& target : {kDelta, kH, kSkew}) add(wave(turn, target, {0.2, 0.2, 6}));
    add(saw_tooth(turn, kDelta));
    add(relay(turn, kBias));
    const auto forwards = shared(turns_added_up(log_, true));
    const auto backwards = shared(turns_added_up(log_, false));
    add_of_turns(forwards);
    if (any_ || backwards->value != forwards->value) add_of_turns(backwards);
    if (angles_.size() == 2) add(line_times_line(turn, angles_[1], kBias));
  }
  void add_of_turns(const DriverPointer& added_up) {
    const auto [low, high] =
        std::minmax_element(added_up->value[0].begin(), added_up->value[0].end());
    if (!any_ && *high - *low < effect::kTurn_rad) return;  // it is the angle
    for (const Target& target : {kBias, kScale, kDelta, kH})
      add_polynomials(added_up, target, {1, 2, 3});
  }
  /// What goes with the direction of the last move, and not always alike.
  void add_of_directions() {
    if (!clock_) return;
    add(fading_reversal(shared(sign_of_load(log_)), clock_, kBias));
    for (const DriverPointer& direction : directions_) {
      const Target& angle = direction->past.ends_with("of h") ? kH : kDelta;
      for (const Target& target : {kBias, angle}) add(fading_reversal(direction, clock_, target));
      add(fading_direction(direction, clock_, angle));
      for (const DriverPointer& column : columns_) add(line_times_line(direction, column, angle));
      add(line_times_line(direction, clock_, angle));
    }
  }
  /// Where something changes while the head rests.
  void add_of_dwells() {
    for (const CourseOf of : {CourseOf::one, CourseOf::component, CourseOf::step})
      for (const int degree : {1, 2, 3}) add(dwell_course(log_, of, degree));
    for (const CourseOf of : {CourseOf::one, CourseOf::step}) add(ring_down(of));
    // Of the step of the axis itself it is a listed effect.
    for (const CourseOf of : {CourseOf::one, CourseOf::step_of_next, CourseOf::step_after_next,
                              CourseOf::turn_of_delta, CourseOf::turn_of_h})
      add(decay_in_dwell(of));
    for (const EventShape shape : {EventShape::step, EventShape::window})
      add(event_of_dwells(shape));
    for (const auto angle : kSwinging) add(swinging_angle(angle));
    for (const auto* drivers : {&columns_, &rates_, &attitude_})
      for (const DriverPointer& driver : *drivers)
        for (const StrengthBy by : {StrengthBy::value, StrengthBy::size})
          add(line_of_driver(driver, by));
    for (const DriverPointer& driver : attitude_) add(line_of_driver(driver, StrengthBy::square));
    for (const auto angle : {&HeadGeometry::delta_rad, &HeadGeometry::h_rad})
      for (const SetOffBy by :
           {SetOffBy::arrival, SetOffBy::weight, SetOffBy::way, SetOffBy::direction}) {
        add(head_decay(angle, by));
        if (by == SetOffBy::arrival || by == SetOffBy::way) add(head_ringing(angle, by));
      }
  }
  void add_of_code(const DriverPointer& code) {
    // What repeats from step to step, or every second step, is the rounding itself, or a bit.
    constexpr double kShortestWave = 2.5;  // steps
    add(wave(code, kBias, {1.5, 0.5, 40}, log_.adc ? kShortestWave * log_.adc->lsb_V() : 0));
    add_polynomials(code, kBias, {2, 3, 5});
    add(bend(code, kBias));
    add_steps(code, kBias);
    add(seam(code, kBias));
    add(missing_band(code, kBias));
    add(bit_of_code(code, kBias, log_.adc));
    add(saw_tooth(code, kBias));
    add(pulses(code, kBias));
  }

  const VisitLog& log_;
  bool any_;
  std::vector<DriverPointer> columns_;     ///< recorded, but for their rates
  std::vector<DriverPointer> angles_;      ///< delta, then h
  std::vector<DriverPointer> attitude_;    ///< h, then the components of the specific force
  std::vector<DriverPointer> directions_;  ///< two-valued
  std::vector<DriverPointer> rates_;       ///< of recorded columns
  DriverPointer clock_;
  std::vector<std::unique_ptr<SmoothTerm>> terms_;
};

}  // namespace

std::vector<std::unique_ptr<SmoothTerm>> smooth_terms(const VisitLog& log,
                                                      SmoothTermSelection selection) {
  TermList list(log, selection);
  list.add_all();
  return list.take();
}

const SmoothTerm* find_term(const std::vector<std::unique_ptr<SmoothTerm>>& terms,
                            const std::string& driver, const std::string& form,
                            const std::string& shape) {
  const auto found = std::find_if(terms.begin(), terms.end(),
                                  [&](const auto& term) { return term->is(driver, form, shape); });
  return found == terms.end() ? nullptr : found->get();
}

}  // namespace plumbline
