// Structure without a name within the dwells.
#pragma once

#include <memory>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// What a course over the dwell is multiplied with.
enum class CourseOf {
  one,
  component,
  step,
  step_of_next,
  step_after_next,
  turn_of_delta,
  turn_of_h
};

/// The same course in every dwell: a polynomial of the logarithm of the time since arrival, without
/// its mean over the dwell.
std::unique_ptr<SmoothTerm> dwell_course(const VisitLog& log, CourseOf of, int degree);

/// A sine that every arrival sets off and that dies away, exp(−t/τ)·(c·cos 2πft + s·sin 2πft), of
/// unknown frequency: of one size, or of the size of the step.
std::unique_ptr<SmoothTerm> ring_down(CourseOf of);

/// What dies away after every arrival, exp(−t/τ): of one size, or of the size of what `of` says.
std::unique_ptr<SmoothTerm> decay_in_dwell(CourseOf of);

/// A step at one time after every arrival, or a window between two: where something shows in every
/// dwell (VisitLog::event), and a step also where step_contrasts() have one.
enum class EventShape { step, window };
std::unique_ptr<SmoothTerm> event_of_dwells(EventShape shape);

}  // namespace plumbline
