// A calibration in a few lines for the person at the terminal.
#pragma once

#include <optional>
#include <string>

#include "estimator/calibrate.h"

namespace plumbline::app {

/// Poses, parameters with expanded uncertainties (k = 2), errors against the noise floor, verdict
/// and decision. The last line is conclusion().
std::string summary(const RunDescription& description, const Calibration& calibration,
                    const std::optional<Evaluation>& verification);

/// One sentence that says what came out, without newline.
std::string conclusion(const RunDescription& description, const Calibration& calibration,
                       const std::optional<Evaluation>& verification);

/// Errors of both models on another set; the last line says whether the limit is kept.
std::string evaluation_summary(const Evaluation& evaluation, const std::optional<Limits>& limits);

}  // namespace plumbline::app
