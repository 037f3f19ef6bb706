#include "estimator/effects/smooth_term.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimator/effects/driver.h"
#include "estimator/effects/dwell_course.h"
#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/head_decay.h"
#include "estimator/effects/memory_term.h"

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

}  // namespace

std::vector<std::unique_ptr<SmoothTerm>> smooth_terms(const VisitLog& log,
                                                      SmoothTermSelection selection) {
  const bool any = selection == SmoothTermSelection::any;
  std::vector<std::unique_ptr<SmoothTerm>> terms;
  const auto add = [&](std::unique_ptr<SmoothTerm> term) { terms.push_back(std::move(term)); };
  const auto add_polynomials = [&](const DriverPointer& driver, const Target& target,
                                   std::initializer_list<int> degrees) {
    for (const int degree : degrees)
      add(driver->angle ? harmonic_series(driver, target, degree)
                        : polynomial(driver, target, degree));
  };
  const auto add_steps = [&](const DriverPointer& driver, const Target& target) {
    for (const StepEdge edge : {StepEdge::sharp, StepEdge::gradual})
      add(step(driver, target, edge));
  };
  const Target bias{TermForm::bias}, scale{TermForm::scale};
  const Target of_delta{TermForm::geometry}, of_h{TermForm::geometry, &HeadGeometry::h_rad};
  const Target of_roll{TermForm::geometry, &HeadGeometry::roll_rad};
  const Target of_skew{TermForm::geometry, &HeadGeometry::skew_rad};
  std::vector<DriverPointer> columns;
  for (Driver& each : instantaneous_drivers(log)) {
    const auto driver = std::make_shared<const Driver>(std::move(each));
    if (!any && !driver->varies()) continue;  // a variable that never varied drives nothing
    const bool clock = driver->is_clock(), column = driver->recorded && !driver->is_rate();
    if (driver->two_valued) {
      for (const Target& target : {bias, scale, of_h}) add_polynomials(driver, target, {1});
      continue;
    }
    for (const Target& target : {bias, scale, of_delta, of_h}) {
      // A bias or scale that follows the time or a column in a straight line is a listed effect.
      const bool listed = (clock || column) && target.form != TermForm::geometry;
      if (any || !listed) add_polynomials(driver, target, {1});
      add_polynomials(driver, target, {2, 3, 5});
    }
    if (driver->recorded || clock) {
      for (std::size_t other = 1; other < kAxisCount; ++other)
        add_polynomials(driver, {.form = TermForm::scale, .other = other}, {1, 2});
      for (std::size_t other = 0; other < kAxisCount; ++other)
        for (std::size_t second = other; second < kAxisCount; ++second)
          add_polynomials(driver, {.form = TermForm::scale, .other = other, .second = second}, {1});
      add_polynomials(driver, of_roll, {1, 2, 3});
      add_polynomials(driver, of_skew, {1, 2});
    }
    if (clock || column) {
      add(bend(driver, bias));
      add(bend(driver, scale));
    }
    if (column) {
      columns.push_back(driver);
      add_steps(driver, bias);
      add_steps(driver, scale);
      add(play(driver, bias));
      add(play(driver, scale));
    }
    if (clock) {
      add(bell(driver, bias));
      add(pulses(driver, bias));
      for (const Target& target : {bias, scale}) {
        add(power(driver, target));
        add(logarithm(driver, target));
      }
      for (const Target& target : {bias, scale, of_delta, of_h, of_roll})
        add(wave(driver, target, {1.5, 0.5, 40}));
      // For the bias both are listed effects, and a step of delta is a slipped index.
      for (const Target& target : {scale, of_h, of_roll}) {
        add_steps(driver, target);
        add(decay(driver, target));
      }
    }
    if (driver->in_the_twelve) {
      // Products of third order.
      for (std::size_t other = 1; other < kAxisCount; ++other)
        add_polynomials(driver, {.form = TermForm::scale, .other = other}, {2});
      for (std::size_t other = 0; other < kAxisCount; ++other)
        for (std::size_t second = other + 1; second < kAxisCount; ++second)
          add_polynomials(driver, {.form = TermForm::scale, .other = other, .second = second}, {1});
      add(bend(driver, bias));
      add(bend(driver, scale));
      add_steps(driver, bias);
    }
    if (driver->angle) {
      for (std::size_t other = 1; other < kAxisCount; ++other)
        add_polynomials(driver, {.form = TermForm::scale, .other = other}, {2, 3});
      for (const Target& target : {bias, of_delta, of_h}) add(bell(driver, target));
      for (const Target& target : {of_roll, of_skew}) add_polynomials(driver, target, {1, 2});
    }
    if (driver->name == "h_deg") {
      // Second to eighth harmonic of the turn that is seen in part; the first is a listed effect.
      const auto [low, high] =
          std::minmax_element(driver->value[0].begin(), driver->value[0].end());
      const double turns = driver->varies() ? (*high - *low) / effect::kTurn_rad : 1;
      for (const Target& target : {bias, of_h})
        add(wave(driver, target, {2 * turns, turns, 8 * turns}));
    }
  }
  // What winds up with the spindle does not know that 360° are 0°.
  const auto turn = std::make_shared<const Driver>(angle_without_return(log));
  for (const Target& target : {bias, scale, of_delta, of_h}) {
    add_polynomials(turn, target, {1, 2, 3});
  }
  for (const Target& target : {of_delta, of_h, of_skew}) add(wave(turn, target, {0.2, 0.2, 6}));
  const auto attitude = std::make_shared<const Driver>(load(log));
  if (any || attitude->varies()) add(play(attitude, bias));
  const double longest_s =
      any ? std::numeric_limits<double>::infinity() : log.last_s() - log.first_s();
  for (auto& term : memory_terms(log, longest_s, attitude, columns)) add(std::move(term));
  // What repeats from step to step, or every second step, is the rounding itself, or a bit.
  constexpr double kShortestWave = 2.5;  // steps
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto driver = std::make_shared<const Driver>(code_driver(log, axis));
    if (!any && !driver->varies()) continue;
    add(wave(driver, bias, {1.5, 0.5, 40}, log.adc ? kShortestWave * log.adc->lsb_V() : 0));
    add_polynomials(driver, bias, {2, 3, 5});
    add(bend(driver, bias));
    add_steps(driver, bias);
  }
  for (const CourseOf of : {CourseOf::one, CourseOf::component, CourseOf::step})
    for (const int degree : {1, 2, 3}) add(dwell_course(log, of, degree));
  for (const auto angle : {&HeadGeometry::delta_rad, &HeadGeometry::h_rad})
    for (const DecayOf of : {DecayOf::one, DecayOf::weight, DecayOf::way})
      add(head_decay(angle, of));
  return terms;
}

}  // namespace plumbline
