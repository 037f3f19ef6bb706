// evaluation.json (schema "plumbline.evaluation/1", app/io/schema/evaluation.schema.json).
#pragma once

#include <optional>

#include "app/io/json.h"
#include "app/provenance.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

/// Whether the certified model keeps the limit on every pose of the other set; nothing without a
/// limit.
std::optional<bool> within_limits(const Evaluation& evaluation,
                                  const std::optional<Limits>& limits);

/// `skipped_rows` of the set were refused and skipped on request.
Json evaluation_json(const Evaluation& evaluation, std::size_t skipped_rows,
                     const std::optional<Limits>& limits, const Provenance& provenance);

}  // namespace plumbline::app
