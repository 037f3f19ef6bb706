// A calibration in a few lines for the person at the terminal.
#pragma once

#include <optional>
#include <string>
#include <vector>

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

/// "1 reading", "2 readings"
std::string counted(std::size_t count, const char* singular);

/// For readings that a calibration is applied to; empty when nothing is lacking.
std::string caution(const std::vector<std::string>& lacking,
                    const std::vector<std::string>& left_out);
/// "caution: temp_C from 60 to 85, calibrated from 18.2 to 25.4 (120 readings beyond)"
std::string caution(const BeyondRange& column);

}  // namespace plumbline::app
