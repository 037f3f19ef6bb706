// What in a record at rest is no noise: its answer to what was recorded beside it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Takes out of `record`, samples [first, first + record.size()) of one axis of `table` at an even
/// step_s > 0, what follows the columns recorded with it: straight lines in them, and what a play
/// in them, an average of their past, a threshold or a square does. Where the output answers to the
/// temperature or to humidity, it does so at rest, too, and would be identified as noise that
/// wanders; in the run it is an effect, and has to stand out from the noise. Answers are taken one
/// after the other, each time the likeliest, as long as the record's means over short spans become
/// clearly likelier, those that are no straight line by more: full likelihood, the answers beside a
/// constant, the noise with all its slow processes estimated anew each time (reml.h). Returns the
/// names of the columns; empty, and the record untouched, where there are none or the record is too
/// short to tell.
std::vector<std::string> take_out_columns(std::vector<double>& record, const SampleTable& table,
                                          std::size_t first, double step_s);

}  // namespace plumbline
