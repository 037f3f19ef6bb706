// What happened again and again may be one thing that repeats.
#pragma once

#include "estimator/diagnosis/search_model.h"

namespace plumbline {

/// Puts one effect in the place of several of the model's that are instances of it: a slip that
/// comes back at every visit, steps at regular times.
void tell_in_one(SearchModel& model);

/// Adds a train of steps at regular times that say nothing one by one, or puts it in the place of
/// what steps on that axis already. Whether there was one.
bool add_train(SearchModel& model);

}  // namespace plumbline
