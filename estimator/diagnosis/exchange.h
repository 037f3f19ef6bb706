// What was chosen first was chosen while the others were still missing, and with noise that had to
// take up what was not in the model: it may have to give way.
#pragma once

#include <cstddef>

#include "estimator/diagnosis/search_model.h"

namespace plumbline {

/// Replaces one of the model's effects, or two, by a single one that explains as much for less.
/// Whether there was one.
bool exchange_one(SearchModel& model);

/// Replaces all of the model's effects, or all but one, by effects of one kind, each on an axis of
/// its own, that explain as much for less: what the triad has in common looks like the head's
/// doing. Whether there were any.
bool exchange_for_one_kind(SearchModel& model);

/// What has no name gives way to effects that have one, as many as it takes, where these are worth
/// their price: two of them together may have looked like one structure. What moves the head and
/// has no name gives way to less of the same beside one with a name, too. Whether anything did.
bool name_unlisted(SearchModel& model);

/// The same for effect k where it is slow and there is slow noise: the rivals are compared each
/// with the noise that suits it.
bool exchange_slow(SearchModel& model, std::size_t k);

}  // namespace plumbline
