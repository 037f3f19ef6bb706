// What switches between two levels at any times looks like steps, waves and windows of the time.
#pragma once

#include "estimator/diagnosis/search_model.h"

namespace plumbline {

/// Puts one switching between two levels in the place of several of the model's effects that follow
/// the time, or of all that the axis (or the head) has, where that explains as much for less.
/// Whether there was one.
bool tell_by_switching(SearchModel& model);

}  // namespace plumbline
