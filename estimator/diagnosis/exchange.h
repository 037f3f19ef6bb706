// What was chosen first was chosen while the others were still missing, and with noise that had to
// take up what was not in the model: it may have to give way.
#pragma once

#include <cstddef>
#include <vector>

#include "estimator/diagnosis/search_model.h"

namespace plumbline {

/// By how much what takes another's place must be cheaper, in χ².
inline constexpr double kWorthExchanging = 2;

/// Exchanges effects for others, and drops what that makes superfluous, unless slow noise would
/// have to take up what the others leave: the noise as it stands was estimated beside what is to
/// go. `more_names`: by how many the newcomers have more than the others. Whether it did.
bool exchange_in_own_noise(SearchModel& model, const std::vector<std::size_t>& effects,
                           const std::vector<SearchModel::Entry>& with, double more_names);

/// Replaces one of the model's effects, two, all of an axis or all of the head, by a single one
/// that explains as much for less. Whether there was one.
bool exchange_one(SearchModel& model);

/// Replaces all of the model's effects, or all but one, by effects of one kind, each on an axis of
/// its own, that explain as much for less: what the triad has in common looks like the head's
/// doing. Whether there were any.
bool exchange_for_one_kind(SearchModel& model);

/// As exchange_one(), of effect k alone, where it is slow and there is slow noise: the rivals are
/// compared each with the noise that suits it.
bool exchange_slow(SearchModel& model, std::size_t k);

}  // namespace plumbline
