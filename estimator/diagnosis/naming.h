// What the search could only tell as a structure may be several effects that have names.
#pragma once

#include "estimator/diagnosis/search_model.h"

namespace plumbline {

/// What has no name gives way to effects that have one, as many as it takes, where these are worth
/// their price: two of them together may have looked like one structure. What moves the head and
/// has no name gives way to less of the same beside one with a name, too. Whether anything did.
bool name_unlisted(SearchModel& model);

}  // namespace plumbline
