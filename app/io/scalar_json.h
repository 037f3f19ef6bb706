// result.json of a calibration without angles: `scalar` instead of `estimates` and `final`.
#pragma once

#include "app/io/json.h"
#include "app/provenance.h"
#include "app/scalar_job.h"

namespace plumbline::app {

/// Depends on the data and the seed alone, `provenance` apart.
Json scalar_json(const ScalarCalibration& calibration, const ScalarSource& source,
                 const Provenance& provenance);

}  // namespace plumbline::app
