// Measurement files as app/io/csv.h reads them. Numbers are written with the fewest digits that
// read back to the same double, so a written and re-read set calibrates to the same bytes.
#pragma once

#include <filesystem>

#include "estimator/measurement.h"

namespace plumbline::app {

/// samples.csv; encoder, temperature and covariate columns where the set has them. Fails (output)
/// with path and reason and then leaves no trace.
Result<void> write_samples(const std::filesystem::path& path, const MeasurementSet& set);

/// static.csv; likewise.
Result<void> write_static(const std::filesystem::path& path, const SampleTable& samples);

}  // namespace plumbline::app
